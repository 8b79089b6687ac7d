// SPDX-License-Identifier: Apache-2.0
// What a swarm does as whoever knows its published poses alone finds it: the twin then says of a
// run what `twinmill swarm metrics` says of the run's log, and of real robots.
#ifndef SWARM_RECENT_POSES_H
#define SWARM_RECENT_POSES_H

#include <deque>
#include <vector>

#include "plant/plant.h"
#include "swarm/metrics.h"

namespace twin
{

class RecentPoses
{
public:
    struct Sample
    {
        double t_s;
        Pose2 pose;  // theta_rad without jumps
    };
    explicit RecentPoses(int robots) : tracks_(static_cast<size_t>(robots)) {}

    // As published: with noise, and `t_s` by the clock of who measured it, from the run's start.
    void Add(int robot, double t_s, const Pose2 &pose);

    // Over the newest 10 s, at times 50 ms apart, velocities fitted to the poses (Savitzky and
    // Golay 1964, 9 points, second order), as calibration/twinmill/swarm/metrics.py does. NaN while
    // there are fewer times than that.
    Metrics Mean(const Ring &ring, const MetricScale &scale) const;

private:
    struct Track
    {
        double first_s = 0;
        std::deque<Sample> samples;  // the newest ones
    };
    std::vector<Track> tracks_;
};

}  // namespace twin

#endif

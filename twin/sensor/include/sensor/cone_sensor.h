// SPDX-License-Identifier: Apache-2.0
// The camera as one bit per frame: geometry, errors and delays.
#ifndef SENSOR_CONE_SENSOR_H
#define SENSOR_CONE_SENSOR_H

#include <cstdint>
#include <deque>
#include <optional>
#include <span>

#include "plant/random.h"
#include "sensor/view.h"

namespace twin
{

// One frame of the sensor that has reached the controller.
struct SensorFrame
{
    bool detected;
    uint32_t seq;
    int64_t utime_us;  // time stamp
};

class ConeSensor
{
public:
    // `sight` is this robot's own, effects included (Model::MakeSight).
    ConeSensor(const Sight &sight, int robot, uint64_t seed);

    // Exposes a frame at `utime_us`, misses and imagines targets at the given rates, and stamps it
    // age_s later. Returns the newest frame whose stamp is delay_s old or older; none if no further
    // one has arrived.
    std::optional<SensorFrame> Expose(std::span<const Pose2> poses, int64_t utime_us)
    {
        return Expose(poses, self_, utime_us);
    }
    // The same where `self` is this robot's place in `poses`, which may leave out robots that are
    // ReachM() away or farther.
    std::optional<SensorFrame> Expose(std::span<const Pose2> poses, size_t self, int64_t utime_us);

    // Robots farther away do not matter; infinite if the range has a soft edge.
    double ReachM() const;

private:
    bool Seen(std::span<const Pose2> poses, size_t self);

    Sight sight_;
    size_t self_;
    Random random_;
    int64_t age_us_, delay_us_;
    uint32_t seq_ = 0;
    std::deque<SensorFrame> on_the_way_;
};

}  // namespace twin

#endif

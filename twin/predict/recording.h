// SPDX-License-Identifier: Apache-2.0
// How the wheels moved along a track, and a robot moved by it: wheels do not feel where the robot
// is.
#ifndef PREDICT_RECORDING_H
#define PREDICT_RECORDING_H

#include <algorithm>
#include <vector>

#include "playback.h"
#include "samples.h"

namespace twin
{

struct WheelStep
{
    double t_s, dt_s;
    Rolling rolling;
};

struct Recording
{
    std::vector<double> event_t_s;
    std::vector<WheelStep> steps;
    std::vector<size_t> reached;  // by event: steps made when its time is reached

    bool IsAt(const std::vector<Sample> &measured) const
    {
        return std::ranges::equal(event_t_s, measured, {}, {}, &Sample::t_s);
    }
};

inline Recording Record(const DriveChain &chain, const Track &track,
                        const std::vector<Sample> &measured)
{
    Recording recording;
    recording.steps.reserve(track.command_t_s.size() + 2 * measured.size());
    RobotState state = chain.Start({});
    Playback playback(track);
    for (const Sample &sample : measured)
    {
        playback.Advance(sample.t_s, [&](const Command &command, double t_s, double dt_s) {
            const WheelMotion motion = chain.DriveWheels(command, t_s, dt_s, state);
            recording.steps.push_back({t_s, dt_s, chain.Roll(motion)});
        });
        recording.event_t_s.push_back(sample.t_s);
        recording.reached.push_back(recording.steps.size());
    }
    return recording;
}

// The robot moved along its course by a step.
inline void Move(const DriveChain &chain, const WheelStep &step, Course &course, RobotState &state)
{
    state.pose = course.pose();
    course.Follow(chain.OnFloor(step.rolling, course.ahead(), step.t_s, step.dt_s, state, nullptr),
                  step.dt_s);
}

// The same over steps [from, to) of the recording.
inline void Move(const DriveChain &chain, const Recording &recording, size_t from, size_t to,
                 Course &course, RobotState &state)
{
    for (size_t i = from; i < to; ++i)
        Move(chain, recording.steps[i], course, state);
}

}  // namespace twin

#endif

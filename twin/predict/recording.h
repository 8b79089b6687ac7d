// SPDX-License-Identifier: Apache-2.0
// How the wheels moved along a track, and a robot moved by it: wheels do not feel where the robot
// is.
#ifndef PREDICT_RECORDING_H
#define PREDICT_RECORDING_H

#include <algorithm>
#include <memory>
#include <vector>

#include "playback.h"
#include "samples.h"

namespace twin
{

// The steps of a track, which end at each command and at the times of some poses: the same of all
// models that know the robot's clock alike.
struct Plan
{
    struct Step
    {
        Command command;
        double t_s, dt_s;
    };
    std::vector<double> event_t_s;
    std::vector<Step> steps;
    std::vector<size_t> reached;  // by event: steps made when its time is reached

    Plan(const Track &track, const std::vector<Sample> &measured)
    {
        steps.reserve(track.command_t_s.size() + 2 * measured.size());
        Playback playback(track);
        for (const Sample &sample : measured)
        {
            playback.Advance(sample.t_s, [&](const Command &command, double t_s, double dt_s) {
                steps.push_back({command, t_s, dt_s});
            });
            event_t_s.push_back(sample.t_s);
            reached.push_back(steps.size());
        }
    }

    bool IsAt(const std::vector<Sample> &measured) const
    {
        return std::ranges::equal(event_t_s, measured, {}, {}, &Sample::t_s);
    }
};

// The plan of these samples: a known one, or the track's last one, if it is theirs.
inline std::shared_ptr<const Plan> PlanOf(const Track &track, const std::vector<Sample> &measured,
                                          const std::shared_ptr<const Plan> &known)
{
    if (known && known->IsAt(measured))
        return known;
    if (!track.last_plan)
        return std::make_shared<const Plan>(track, measured);
    const std::scoped_lock lock(track.last_plan->held);
    std::shared_ptr<const Plan> &last = track.last_plan->plan;
    if (!last || !last->IsAt(measured))
        last = std::make_shared<const Plan>(track, measured);
    return last;
}

struct Recording
{
    std::shared_ptr<const Plan> plan;
    std::vector<Rolling> rolled;  // in each step
};

inline Recording Record(const DriveChain &chain, const std::shared_ptr<const Plan> &plan)
{
    Recording recording{plan, {}};
    recording.rolled.reserve(plan->steps.size());
    RobotState state = chain.Start({});
    for (const Plan::Step &step : plan->steps)
        recording.rolled.push_back(
            chain.Roll(chain.DriveWheels(step.command, step.t_s, step.dt_s, state)));
    return recording;
}

// The robot moved along its course over steps [from, to) of the recording.
inline void Move(const DriveChain &chain, const Recording &recording, size_t from, size_t to,
                 Course &course, RobotState &state)
{
    const std::vector<Plan::Step> &steps = recording.plan->steps;
    const auto on_floor = [&](size_t i, const Direction &ahead) {
        return chain.OnFloor(recording.rolled[i], ahead, steps[i].t_s, steps[i].dt_s, state,
                             nullptr);
    };
    if (!chain.IsHomogeneous())
    {
        for (size_t i = from; i < to; ++i)
        {
            state.pose = course.pose();
            course.Follow(on_floor(i, course.ahead()), steps[i].dt_s);
        }
        return;
    }
    // No velocity waits for the pose, which nothing else sees: it stays in registers.
    Course here = course;
    for (size_t i = from; i < to; ++i)
        here.Follow(chain.IsBare() ? chain.Geared(recording.rolled[i]) : on_floor(i, {}),
                    steps[i].dt_s);
    course = here;
}

}  // namespace twin

#endif

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
    std::vector<double> event_t_s;
    std::vector<DriveStep> steps;
    std::vector<size_t> reached;  // by event: steps made when its time is reached
    double lag_s;                 // of the model that it was made for
    std::vector<Decay> decays;    // of this lag, by step

    Plan(const Track &track, const std::vector<Sample> &measured, double lag) : lag_s(lag)
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
        decays = DecaysOf(lag);
    }

    bool IsAt(const std::vector<Sample> &measured) const
    {
        return std::ranges::equal(event_t_s, measured, {}, {}, &Sample::t_s);
    }

    std::vector<Decay> DecaysOf(double of_lag_s) const
    {
        std::vector<Decay> found;
        found.reserve(steps.size());
        for (const DriveStep &step : steps)
            found.push_back(Decay::Over(step.dt_s, of_lag_s));
        return found;
    }
};

// How the wheels of a robot rolled in each step.
struct Recording
{
    std::shared_ptr<const DriveChain> chain;
    std::shared_ptr<const Plan> plan;
    std::vector<Rolling> rolled;
};

// The plan of these samples: a known one, or one of late.
inline std::shared_ptr<const Plan> PlanOf(const Track &track, const DriveChain &chain,
                                          const std::vector<Sample> &measured,
                                          const std::shared_ptr<const Plan> &known,
                                          Recordings &recordings)
{
    if (known && known->IsAt(measured))
        return known;
    const std::scoped_lock lock(recordings.held);
    for (const auto &recording : recordings.of_late)
        if (recording->plan->IsAt(measured))
            return recording->plan;
    std::shared_ptr<const Plan> &last = recordings.last_plan;
    if (!last || !last->IsAt(measured))
        last = std::make_shared<const Plan>(track, measured, chain.LagS());
    return last;
}

// One of late with wheels that move alike, or a new one, which stays there if it is `kept`.
inline std::shared_ptr<const Recording> RecordingOf(const std::shared_ptr<const DriveChain> &chain,
                                                    const std::shared_ptr<const Plan> &plan,
                                                    bool kept, Recordings &recordings)
{
    constexpr size_t kMost = 4;
    auto &late = recordings.of_late;
    {
        const std::scoped_lock lock(recordings.held);
        const auto found = std::ranges::find_if(late, [&](const auto &known) {
            return known->plan == plan && known->chain->DrivesAs(*chain);
        });
        if (found != late.end())
        {
            std::rotate(late.begin(), found, found + 1);
            return late.front();
        }
    }
    std::vector<Decay> own;
    if (chain->IsPrompt() && chain->LagS() != plan->lag_s)
        own = plan->DecaysOf(chain->LagS());
    const auto made = std::make_shared<const Recording>(
        chain, plan, chain->RollThrough(plan->steps, own.empty() ? plan->decays : own));
    if (kept)
    {
        const std::scoped_lock lock(recordings.held);
        late.insert(late.begin(), made);
        late.resize(std::min(late.size(), kMost));
    }
    return made;
}

// The robot moved along its course over steps [from, to) of the recording.
inline void Move(const DriveChain &chain, const Recording &recording, size_t from, size_t to,
                 Course &course, RobotState &state)
{
    const std::vector<DriveStep> &steps = recording.plan->steps;
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

// SPDX-License-Identifier: Apache-2.0
// Predictions over windows that overlap. How the wheels move does not depend on where the robot is:
// it is recorded once for the whole track, and all windows, and all models that differ on the
// ground alone, share it.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "playback.h"
#include "samples.h"

namespace twin
{
namespace
{

struct Windows
{
    const Track &track;
    std::span<const int64_t> starts, ends;

    size_t Horizons() const { return starts.empty() ? 0 : ends.size() / starts.size(); }
};

// Poses at which some window starts or ends, ascending.
std::vector<size_t> Events(const Windows &windows)
{
    std::vector<size_t> events;
    for (const auto &list : {windows.starts, windows.ends})
        for (const int64_t k : list)
            if (k >= 0)
                events.push_back(static_cast<size_t>(k));
    std::ranges::sort(events);
    events.erase(std::unique(events.begin(), events.end()), events.end());
    return events;
}

struct Event
{
    size_t pose;
    Sample measured;
};

std::vector<Event> MeasuredAt(const DriveChain &chain, const Track &track,
                              const std::vector<size_t> &poses)
{
    std::vector<Event> events;
    events.reserve(poses.size());
    for (const size_t k : poses)
        events.push_back({k, Measured(chain, track, k)});
    return events;
}

struct WheelStep
{
    double t_s, dt_s;
    WheelMotion motion;
};

struct Recording
{
    std::vector<double> event_t_s;
    std::vector<WheelStep> steps;
    std::vector<size_t> reached;  // by event: steps made when its time is reached

    bool IsAt(const std::vector<Event> &events) const
    {
        return std::ranges::equal(event_t_s, events, {}, {},
                                  [](const Event &e) { return e.measured.t_s; });
    }
};

Recording Record(const DriveChain &chain, const Track &track, const std::vector<Event> &events)
{
    Recording recording;
    RobotState state = chain.Start({});
    Playback playback(track);
    for (const Event &event : events)
    {
        playback.Advance(event.measured.t_s, [&](const Command &command, double t_s, double dt_s) {
            recording.steps.push_back({t_s, dt_s, chain.DriveWheels(command, t_s, dt_s, state)});
        });
        recording.event_t_s.push_back(event.measured.t_s);
        recording.reached.push_back(recording.steps.size());
    }
    return recording;
}

// The robot moved over steps [from, to) of the recording.
void Move(const DriveChain &chain, const Recording &recording, size_t from, size_t to,
          RobotState &state)
{
    for (size_t i = from; i < to; ++i)
    {
        const WheelStep &step = recording.steps[i];
        const Twist velocity = chain.BodyTwist(step.motion, step.t_s, step.dt_s, state, nullptr);
        state.pose = AlongArc(state.pose, velocity, step.dt_s);
    }
}

// Where a robot that starts at `start` gets to while one that starts at `from` gets to `to`.
Pose2 Moved(const Pose2 &start, const Pose2 &from, const Pose2 &to)
{
    const double turn_rad = start.theta_rad - from.theta_rad;
    const double c = std::cos(turn_rad), s = std::sin(turn_rad);
    const double x_m = to.x_m - from.x_m, y_m = to.y_m - from.y_m;
    return {start.x_m + c * x_m - s * y_m, start.y_m + s * x_m + c * y_m, to.theta_rad + turn_rad};
}

// By event: what effects on the ground remember there, moved from measured pose to measured pose;
// empty where none remembers.
std::vector<std::vector<double>> Remembered(const DriveChain &chain,
                                            const std::vector<Event> &events,
                                            const Recording &recording)
{
    std::vector<std::vector<double>> remembered;
    if (!chain.RemembersOnGround())
        return remembered;
    RobotState state = chain.Start({});
    size_t done = 0;
    for (size_t e = 0; e < events.size(); ++e)
    {
        if (e > 0)
            state.pose = events[e - 1].measured.pose;
        Move(chain, recording, done, recording.reached[e], state);
        done = recording.reached[e];
        remembered.push_back(state.effect_state);
    }
    return remembered;
}

// All windows of one model, written to `out` (W, H, 3).
void Predict(const DriveChain &chain, const Windows &windows, const std::vector<Event> &events,
             const Recording &recording, double *out)
{
    const auto event_of = [&](int64_t pose) {
        const auto at =
            std::ranges::lower_bound(events, static_cast<size_t>(pose), {}, &Event::pose);
        return static_cast<size_t>(at - events.begin());
    };
    RobotState state = chain.Start({});
    std::vector<Pose2> path;  // by event: of a robot that begins at the origin
    if (chain.IsHomogeneous())
    {
        size_t done = 0;
        for (const size_t reached : recording.reached)
        {
            Move(chain, recording, done, reached, state);
            path.push_back(state.pose);
            done = reached;
        }
    }
    const auto remembered = Remembered(chain, events, recording);
    const size_t horizons = windows.Horizons();
    for (size_t w = 0; w < windows.starts.size(); ++w)
    {
        const size_t from = event_of(windows.starts[w]);
        state.pose = events[from].measured.pose;
        if (!remembered.empty())
            state.effect_state = remembered[from];
        size_t done = recording.reached[from];
        for (size_t h = w * horizons; h < (w + 1) * horizons && windows.ends[h] >= 0; ++h)
        {
            const size_t to = event_of(windows.ends[h]);
            if (chain.IsHomogeneous())
            {
                WriteSeen(chain, Moved(state.pose, path[from], path[to]), out + 3 * h);
                continue;
            }
            Move(chain, recording, done, recording.reached[to], state);
            done = recording.reached[to];
            WriteSeen(chain, state.pose, out + 3 * h);
        }
    }
}

// By row of values: whether they leave the wheels' motion as it is, but for the times of poses.
std::vector<char> OnGroundAlone(const Model &model, const std::vector<std::string> &names,
                                std::span<const double> values)
{
    std::vector<char> alone(names.empty() ? 0 : values.size() / names.size(), true);
    for (size_t p = 0; p < names.size(); ++p)
    {
        const Parameter own = model.Find(names[p]);
        const std::string_view stage = own.stage;
        if (stage == "ground" || stage == "observe")
            continue;
        for (size_t b = 0; b < alone.size(); ++b)
            alone[b] = alone[b] && values[b * names.size() + p] == own.value;
    }
    return alone;
}

}  // namespace

std::vector<double> PredictWindows(const Model &model, const Track &track,
                                   std::span<const int64_t> starts, std::span<const int64_t> ends)
{
    const Windows windows{track, starts, ends};
    const DriveChain chain(model);
    const auto events = MeasuredAt(chain, track, Events(windows));
    std::vector<double> predicted(3 * ends.size(), kNaN);
    Predict(chain, windows, events, Record(chain, track, events), predicted.data());
    return predicted;
}

std::vector<double> PredictWindowsBatch(const Model &model, const Track &track,
                                        std::span<const int64_t> starts,
                                        std::span<const int64_t> ends,
                                        const std::vector<std::string> &names,
                                        std::span<const double> values)
{
    const Windows windows{track, starts, ends};
    const std::vector<size_t> poses = Events(windows);
    const std::vector<Model> models = ModelsOf(model, names, values);
    const std::vector<char> grounded = OnGroundAlone(model, names, values);
    Recording shared;
    if (std::ranges::count(grounded, true) > 0)
    {
        const DriveChain own(model);
        shared = Record(own, track, MeasuredAt(own, track, poses));
    }
    std::vector<double> predicted(models.size() * 3 * ends.size(), kNaN);
    InParallel(models.size(), [&](size_t b) {
        const DriveChain chain(models[b]);
        const auto events = MeasuredAt(chain, track, poses);
        const bool same = grounded[b] && shared.IsAt(events);
        const Recording own = same ? Recording{} : Record(chain, track, events);
        Predict(chain, windows, events, same ? shared : own,
                predicted.data() + b * 3 * ends.size());
    });
    return predicted;
}

}  // namespace twin

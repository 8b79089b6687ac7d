// SPDX-License-Identifier: Apache-2.0
// Predictions over windows that overlap. How the wheels move does not depend on where the robot is:
// it is recorded once for the whole track, and all windows, and all models that differ on the
// ground alone, share it.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "recording.h"
#include "samples.h"

namespace twin
{
namespace
{

struct Windows
{
    const Track &track;
    std::span<const int64_t> starts, ends, part{};

    size_t Horizons() const { return starts.empty() ? 0 : ends.size() / starts.size(); }
    bool AreOf(size_t row, size_t window) const
    {
        return part.empty() || part[window] == static_cast<int64_t>(row);
    }
};

// Poses at which some window starts or ends.
class Events
{
public:
    explicit Events(const Windows &windows) : number_(windows.track.pose_t_s.size())
    {
        std::vector<char> used(number_.size(), false);
        for (const auto &list : {windows.starts, windows.ends})
            for (const int64_t pose : list)
                if (pose >= 0)
                    used.at(static_cast<size_t>(pose)) = true;
        for (size_t pose = 0; pose < used.size(); ++pose)
        {
            number_[pose] = poses_.size();
            if (used[pose])
                poses_.push_back(pose);
        }
    }

    // Ascending.
    const std::vector<size_t> &Poses() const { return poses_; }

    // Which of them a pose is.
    size_t At(int64_t pose) const { return number_[static_cast<size_t>(pose)]; }

private:
    std::vector<size_t> number_, poses_;
};

// What was measured at all events, as the robot's own, and the directions in which it heads where
// windows start.
struct Measurements
{
    std::vector<Sample> samples;
    std::vector<Direction> ahead;

    Measurements(const DriveChain &chain, const Windows &windows, const Events &events)
    {
        samples.reserve(events.Poses().size());
        for (const size_t pose : events.Poses())
            samples.push_back(Measured(chain, windows.track, pose));
        ahead.reserve(windows.starts.size());
        for (const int64_t start : windows.starts)
            ahead.push_back(Direction::Of(samples[events.At(start)].pose.theta_rad));
    }
};

// Where a robot that starts on one course gets to while another goes on from its own.
class Shifted
{
public:
    Shifted(const Course &start, const Course &from)
        : start_(start.pose()), from_(from.pose()), turn_(start.ahead().Turned(from.ahead().Back()))
    {
    }

    Pose2 At(const Pose2 &to) const
    {
        const auto [c, s] = turn_;
        const double x_m = to.x_m - from_.x_m, y_m = to.y_m - from_.y_m;
        return {start_.x_m + c * x_m - s * y_m, start_.y_m + s * x_m + c * y_m,
                start_.theta_rad + to.theta_rad - from_.theta_rad};
    }

private:
    Pose2 start_, from_;
    Direction turn_;
};

// By event: what effects on the ground remember there, moved from measured pose to measured pose;
// empty where none remembers.
std::vector<std::vector<double>> Remembered(const DriveChain &chain,
                                            const std::vector<Sample> &measured,
                                            const Recording &recording)
{
    std::vector<std::vector<double>> remembered;
    if (!chain.RemembersOnGround())
        return remembered;
    RobotState state = chain.Start({});
    size_t done = 0;
    for (size_t e = 0; e < measured.size(); ++e)
    {
        Course course(measured[e > 0 ? e - 1 : 0].pose);
        Move(chain, recording, done, recording.plan->reached[e], course, state);
        done = recording.plan->reached[e];
        remembered.push_back(state.effect_state);
    }
    return remembered;
}

// All windows of one model, written to `out` (W, H, 3).
struct Prediction
{
    const DriveChain &chain;
    const Windows &windows;
    const Events &events;
    const Measurements &measured;
    const Recording &recording;
    double *out;
    size_t row = 0;

    void Write() const { chain.IsHomogeneous() ? AlongOnePath() : EachFromItsStart(); }

private:
    Course StartOf(size_t window) const
    {
        const size_t event = events.At(windows.starts[window]);
        return {measured.samples[event].pose, measured.ahead[window]};
    }

    // Calls start(window, event) at each window's begin, then visit(event, out) at each of its
    // ends.
    template <class Start, class Visit>
    void ForEach(Start start, Visit visit) const
    {
        const size_t horizons = windows.Horizons();
        for (size_t w = 0; w < windows.starts.size(); ++w)
        {
            if (!windows.AreOf(row, w))
                continue;
            start(w, events.At(windows.starts[w]));
            for (size_t h = w * horizons; h < (w + 1) * horizons && windows.ends[h] >= 0; ++h)
                visit(events.At(windows.ends[h]), out + 3 * h);
        }
    }

    void AlongOnePath() const
    {
        std::vector<Course> path;  // by event
        path.reserve(recording.plan->reached.size());
        RobotState state = chain.Start({});
        Course course({});
        size_t done = 0;
        for (const size_t reached : recording.plan->reached)
        {
            Move(chain, recording, done, reached, course, state);
            path.push_back(course);
            done = reached;
        }
        const Course nowhere({});
        Shifted shifted(nowhere, nowhere);
        ForEach(
            [&](size_t window, size_t from) { shifted = Shifted(StartOf(window), path[from]); },
            [&](size_t to, double *seen) { WriteSeen(chain, shifted.At(path[to].pose()), seen); });
    }

    // A window under way: which of its ends come next, and what effects remember of its robot.
    struct Walker
    {
        size_t next, last;
        std::vector<double> memory;
    };

    // Windows under way: the course of the i-th is the one at i % kTogether of courses[i /
    // kTogether].
    struct UnderWay
    {
        std::vector<Walker> walkers;
        std::vector<Courses> courses;

        Course CourseOf(size_t i) const { return courses[i / kTogether].At(i % kTogether); }

        void Begin(Walker walker, const Course &course)
        {
            const size_t i = walkers.size();
            if (i == kTogether * courses.size())
                courses.emplace_back();
            courses[i / kTogether].Take(i % kTogether, course);
            walkers.push_back(std::move(walker));
        }

        // The last one takes the place of the i-th.
        void End(size_t i)
        {
            courses[i / kTogether].Take(i % kTogether, CourseOf(walkers.size() - 1));
            std::swap(walkers[i], walkers.back());
            walkers.pop_back();
        }
    };

    // All windows that are under way make a step together.
    void EachFromItsStart() const
    {
        const auto remembered = Remembered(chain, measured.samples, recording);
        const size_t horizons = windows.Horizons();
        const std::vector<double> nothing = chain.Start({}).effect_state;
        UnderWay all;
        size_t window = 0, step = 0;
        for (size_t event = 0; event < measured.samples.size(); ++event)
        {
            for (; step < recording.plan->reached[event]; ++step)
                MoveAll(recording.plan->steps[step], recording.rolled[step], all);
            for (; window < windows.starts.size() && events.At(windows.starts[window]) == event;
                 ++window)
                if (windows.AreOf(row, window))
                    all.Begin({window * horizons, (window + 1) * horizons,
                               remembered.empty() ? nothing : remembered[event]},
                              StartOf(window));
            for (size_t i = all.walkers.size(); i-- > 0;)
                if (IsThrough(all.walkers[i], all.CourseOf(i).pose(), event))
                    all.End(i);
        }
    }

    void MoveAll(const DriveStep &step, const Rolling &rolling, UnderWay &all) const
    {
        for (size_t first = 0; first < all.walkers.size(); first += kTogether)
        {
            Courses &courses = all.courses[first / kTogether];
            const size_t count = std::min(kTogether, all.walkers.size() - first);
            const auto memory = [&](size_t i) { return all.walkers[first + i].memory.data(); };
            courses.Follow(
                chain.OnFloor(rolling, courses.poses(), count, step.t_s, step.dt_s, memory));
        }
    }

    // Writes what is seen at those of a window's ends that are at an event; true if no other comes.
    bool IsThrough(Walker &walker, const Pose2 &pose, size_t event) const
    {
        for (; walker.next < walker.last && windows.ends[walker.next] >= 0; ++walker.next)
        {
            if (events.At(windows.ends[walker.next]) != event)
                return false;
            WriteSeen(chain, pose, out + 3 * walker.next);
        }
        return true;
    }
};

// The short way round.
double Wrapped(double rad)
{
    constexpr double kHalf = std::numbers::pi, kTurn = 2 * kHalf;
    if (std::abs(rad) < kHalf)
        return rad;
    const double part_rad = std::fmod(rad + kHalf, kTurn);
    return (part_rad < 0 ? part_rad + kTurn : part_rad) - kHalf;
}

// Makes weighted errors of poses (B, W, H, 3) that were predicted.
void MakeErrors(const Displaced &displaced, std::vector<double> &poses)
{
    const size_t size = displaced.measured.size(), windows = displaced.start.size() / 3;
    const size_t width = windows > 0 ? size / windows : 0;
    for (size_t w = 0; w < windows; ++w)
    {
        const double *start = &displaced.start[3 * w];
        const double c = std::cos(start[2]), s = std::sin(start[2]);
        for (size_t first = w * width; first < poses.size(); first += size)
            for (size_t at = w * width, h = first; at < (w + 1) * width; at += 3, h += 3)
            {
                const double *measured = &displaced.measured[at], *weight = &displaced.weight[at];
                const double x_m = poses[h] - start[0], y_m = poses[h + 1] - start[1];
                const double error[3] = {measured[0] - (c * x_m + s * y_m),
                                         measured[1] - (c * y_m - s * x_m),
                                         Wrapped(measured[2] - (poses[h + 2] - start[2]))};
                for (size_t k = 0; k < 3; ++k)
                    poses[h + k] = std::isnan(error[k]) ? 0 : error[k] * weight[k];
            }
    }
}

using Chains = std::vector<std::shared_ptr<const DriveChain>>;

// By robot: the first one whose wheels move alike, but for the times of poses.
std::vector<size_t> FirstsAlike(const Chains &chains)
{
    std::vector<size_t> firsts(chains.size());
    for (size_t b = 0; b < chains.size(); ++b)
        while (!chains[firsts[b]]->DrivesAs(*chains[b]))
            ++firsts[b];
    return firsts;
}

// Of each robot (B) all windows, (B, W, H, 3), or with parts (1, W, H, 3).
std::vector<double> PredictEach(const Chains &chains, const Windows &windows)
{
    const Events events(windows);
    const size_t size = 3 * windows.ends.size(), apart = windows.part.empty() ? size : 0;
    std::vector<double> predicted(windows.part.empty() ? chains.size() * size : size, kNaN);
    if (chains.empty())
        return predicted;
    Recordings own;
    Recordings &recordings = windows.track.recordings ? *windows.track.recordings : own;
    const Measurements usual(*chains[0], windows, events);
    const auto plan = PlanOf(windows.track, *chains[0], usual.samples, nullptr, recordings);
    const std::vector<size_t> firsts = FirstsAlike(chains);
    const auto predict = [&](size_t b, bool kept) {
        std::optional<Measurements> other;
        if (!chains[b]->IsSeenAs(*chains[0]))
            other.emplace(*chains[b], windows, events);
        const Measurements &measured = other ? *other : usual;
        const auto recording = RecordingOf(
            chains[b], PlanOf(windows.track, *chains[b], measured.samples, plan, recordings), kept,
            recordings);
        Prediction{*chains[b], windows, events, measured, *recording, predicted.data() + b * apart,
                   b}
            .Write();
    };
    // Those whose recordings others wait for come first, and what is alone may be asked for anew.
    std::vector<size_t> first, others;
    std::vector<char> awaited(chains.size(), chains.size() == 1);
    for (size_t b = 0; b < chains.size(); ++b)
    {
        (firsts[b] == b ? first : others).push_back(b);
        awaited[firsts[b]] |= firsts[b] != b;
    }
    for (const auto &rows : {first, others})
        InParallel(rows.size(), [&](size_t i) { predict(rows[i], awaited[rows[i]]); });
    return predicted;
}

}  // namespace

std::vector<double> PredictWindows(const Model &model, const Track &track,
                                   std::span<const int64_t> starts, std::span<const int64_t> ends)
{
    return PredictEach({std::make_shared<const DriveChain>(model)}, {track, starts, ends});
}

std::vector<double> PredictWindowsBatch(const Model &model, const Track &track,
                                        std::span<const int64_t> starts,
                                        std::span<const int64_t> ends,
                                        const std::vector<std::string> &names,
                                        std::span<const double> values,
                                        std::span<const int64_t> part)
{
    return PredictEach(ChainsOf(model, names, values), {track, starts, ends, part});
}

std::vector<double> WindowErrorsBatch(const Model &model, const Track &track,
                                      std::span<const int64_t> starts,
                                      std::span<const int64_t> ends,
                                      const std::vector<std::string> &names,
                                      std::span<const double> values, const Displaced &displaced,
                                      std::span<const int64_t> part)
{
    auto rows = PredictWindowsBatch(model, track, starts, ends, names, values, part);
    MakeErrors(displaced, rows);
    return rows;
}

}  // namespace twin

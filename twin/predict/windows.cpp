// SPDX-License-Identifier: Apache-2.0
// Predictions over windows that overlap. How the wheels move does not depend on where the robot is:
// it is recorded once for the whole track, and all windows, and all models that differ on the
// ground alone, share it.
#include <algorithm>
#include <cmath>
#include <numbers>
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

std::vector<Sample> MeasuredAt(const DriveChain &chain, const Track &track, const Events &events)
{
    std::vector<Sample> samples;
    samples.reserve(events.Poses().size());
    for (const size_t pose : events.Poses())
        samples.push_back(Measured(chain, track, pose));
    return samples;
}

// Where a robot that starts at `start` gets to while another that starts at `from` goes its way.
class Shifted
{
public:
    Shifted(const Pose2 &start, const Pose2 &from)
        : start_(start),
          from_(from),
          c_(std::cos(start.theta_rad - from.theta_rad)),
          s_(std::sin(start.theta_rad - from.theta_rad))
    {
    }

    Pose2 At(const Pose2 &to) const
    {
        const double x_m = to.x_m - from_.x_m, y_m = to.y_m - from_.y_m;
        return {start_.x_m + c_ * x_m - s_ * y_m, start_.y_m + s_ * x_m + c_ * y_m,
                start_.theta_rad + to.theta_rad - from_.theta_rad};
    }

private:
    Pose2 start_, from_;
    double c_, s_;
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
    const std::vector<Sample> &measured;
    const Recording &recording;
    double *out;
    size_t row = 0;

    void Write() const { chain.IsHomogeneous() ? AlongOnePath() : EachFromItsStart(); }

private:
    // Calls start(event) at each window's begin, then visit(event, out) at each of its ends.
    template <class Start, class Visit>
    void ForEach(Start start, Visit visit) const
    {
        const size_t horizons = windows.Horizons();
        for (size_t w = 0; w < windows.starts.size(); ++w)
        {
            if (!windows.AreOf(row, w))
                continue;
            start(events.At(windows.starts[w]));
            for (size_t h = w * horizons; h < (w + 1) * horizons && windows.ends[h] >= 0; ++h)
                visit(events.At(windows.ends[h]), out + 3 * h);
        }
    }

    void AlongOnePath() const
    {
        std::vector<Pose2> path;  // by event
        RobotState state = chain.Start({});
        Course course({});
        size_t done = 0;
        for (const size_t reached : recording.plan->reached)
        {
            Move(chain, recording, done, reached, course, state);
            path.push_back(course.pose());
            done = reached;
        }
        Shifted shifted({}, {});
        ForEach([&](size_t from) { shifted = Shifted(measured[from].pose, path[from]); },
                [&](size_t to, double *seen) { WriteSeen(chain, shifted.At(path[to]), seen); });
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
        const auto remembered = Remembered(chain, measured, recording);
        const size_t horizons = windows.Horizons();
        const std::vector<double> nothing = chain.Start({}).effect_state;
        UnderWay all;
        size_t window = 0, step = 0;
        for (size_t event = 0; event < measured.size(); ++event)
        {
            for (; step < recording.plan->reached[event]; ++step)
                MoveAll(recording.plan->steps[step], recording.rolled[step], all);
            for (; window < windows.starts.size() && events.At(windows.starts[window]) == event;
                 ++window)
                if (windows.AreOf(row, window))
                    all.Begin({window * horizons, (window + 1) * horizons,
                               remembered.empty() ? nothing : remembered[event]},
                              Course(measured[event].pose));
            for (size_t i = all.walkers.size(); i-- > 0;)
                if (IsThrough(all.walkers[i], all.CourseOf(i).pose(), event))
                    all.End(i);
        }
    }

    void MoveAll(const Plan::Step &step, const Rolling &rolling, UnderWay &all) const
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

// By row of values (B, P): the first row with which the wheels move alike, but for the times of
// poses: numbers of the ground and of what is observed leave that as it is.
std::vector<size_t> FirstsAlike(const Model &model, const std::vector<std::string> &names,
                                std::span<const double> values)
{
    std::vector<size_t> driving;
    for (size_t p = 0; p < names.size(); ++p)
    {
        const std::string_view stage = model.Find(names[p]).stage;
        if (stage != "ground" && stage != "observe")
            driving.push_back(p);
    }
    std::vector<size_t> firsts(names.empty() ? 0 : values.size() / names.size());
    for (size_t b = 0; b < firsts.size(); ++b)
    {
        const auto alike = [&](size_t a) {
            return std::ranges::all_of(driving, [&](size_t p) {
                return values[a * names.size() + p] == values[b * names.size() + p];
            });
        };
        while (!alike(firsts[b]))
            ++firsts[b];
    }
    return firsts;
}

}  // namespace

std::vector<double> PredictWindows(const Model &model, const Track &track,
                                   std::span<const int64_t> starts, std::span<const int64_t> ends)
{
    const Windows windows{track, starts, ends};
    const Events events(windows);
    const DriveChain chain(model);
    const auto measured = MeasuredAt(chain, track, events);
    const Recording recording = Record(chain, PlanOf(track, measured, nullptr));
    std::vector<double> predicted(3 * ends.size(), kNaN);
    Prediction{chain, windows, events, measured, recording, predicted.data()}.Write();
    return predicted;
}

std::vector<double> PredictWindowsBatch(const Model &model, const Track &track,
                                        std::span<const int64_t> starts,
                                        std::span<const int64_t> ends,
                                        const std::vector<std::string> &names,
                                        std::span<const double> values,
                                        std::span<const int64_t> part)
{
    const Windows windows{track, starts, ends, part};
    const Events events(windows);
    const std::vector<Model> models = ModelsOf(model, names, values);
    const std::vector<size_t> firsts = FirstsAlike(model, names, values);
    std::vector<size_t> own, others;
    std::vector<char> awaited(models.size(), false);
    for (size_t b = 0; b < models.size(); ++b)
    {
        (firsts[b] == b ? own : others).push_back(b);
        awaited[firsts[b]] |= firsts[b] != b;
    }
    std::vector<Recording> recordings(models.size());
    std::shared_ptr<const Plan> plan;
    if (!models.empty())
        plan = PlanOf(track, MeasuredAt(DriveChain(models[0]), track, events), nullptr);
    const size_t size = 3 * ends.size(), apart = part.empty() ? size : 0;
    std::vector<double> predicted(part.empty() ? models.size() * size : size, kNaN);
    const auto predict = [&](size_t b) {
        const DriveChain chain(models[b]);
        const auto measured = MeasuredAt(chain, track, events);
        const Recording &first = recordings[firsts[b]];
        const bool shared = first.plan && first.plan->IsAt(measured);
        Recording recording = shared ? Recording{} : Record(chain, PlanOf(track, measured, plan));
        Prediction{chain,
                   windows,
                   events,
                   measured,
                   shared ? first : recording,
                   predicted.data() + b * apart,
                   b}
            .Write();
        if (awaited[b])
            recordings[b] = std::move(recording);
    };
    for (const auto &rows : {own, others})
        InParallel(rows.size(), [&](size_t i) { predict(rows[i]); });
    return predicted;
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

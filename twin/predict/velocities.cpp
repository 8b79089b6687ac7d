// SPDX-License-Identifier: Apache-2.0
// Velocities of one step for many models: those whose wheels move alike share one recording.
#include <algorithm>
#include <cmath>
#include <iterator>

#include "recording.h"
#include "samples.h"

namespace twin
{
namespace
{

std::vector<size_t> Usable(const Track &track)
{
    std::vector<size_t> usable;
    for (size_t k = 0; k < track.segment.size(); ++k)
        if (track.segment[k] >= 0)
            usable.push_back(k);
    return usable;
}

// By pose: the number of the last one before it that is usable, if that is of its segment.
std::vector<size_t> BeforeEach(const Track &track, const std::vector<size_t> &usable)
{
    std::vector<size_t> before(track.segment.size(), SIZE_MAX);
    for (size_t i = 1; i < usable.size(); ++i)
        if (track.segment[usable[i]] == track.segment[usable[i - 1]])
            before[usable[i]] = i - 1;
    return before;
}

// Those of usable poses to which or from which some step is asked for.
std::vector<size_t> Needed(const Track &track, const std::vector<size_t> &usable,
                           std::span<const int64_t> poses)
{
    const std::vector<size_t> before = BeforeEach(track, usable);
    std::vector<char> needed(track.segment.size(), false);
    for (const int64_t asked : poses)
    {
        const auto pose = static_cast<size_t>(asked);
        const size_t from = before.at(pose);
        if (from != SIZE_MAX)
            needed[pose] = needed[usable[from]] = true;
    }
    std::vector<size_t> found;
    std::ranges::copy_if(usable, std::back_inserter(found), [&](size_t k) { return needed[k]; });
    return found;
}

// What was measured at some poses, as the robot's own.
std::vector<Sample> MeasuredAt(const DriveChain &chain, const Track &track,
                               const std::vector<size_t> &poses)
{
    std::vector<Sample> measured;
    measured.reserve(poses.size());
    for (const size_t k : poses)
        measured.push_back(Measured(chain, track, k));
    return measured;
}

// Directions of the headings at some poses of a track. What models observe turns few headings, so
// that one cosine and sine serve all models.
class Headings
{
public:
    Headings(const Track &track, const std::vector<size_t> &poses)
    {
        for (const size_t k : poses)
        {
            measured_rad_.push_back(track.pose[3 * k + 2]);
            ahead_.push_back(Direction::Of(measured_rad_.back()));
        }
    }

    // As measured at the i-th of these poses.
    const Direction &Ahead(size_t i) const { return ahead_[i]; }

    // Of a robot that starts there, at the pose that its own model makes of it.
    Course From(size_t i, const Pose2 &pose) const
    {
        return pose.theta_rad == measured_rad_[i] ? Course(pose, ahead_[i]) : Course(pose);
    }

private:
    std::vector<double> measured_rad_;
    std::vector<Direction> ahead_;
};

// The mean velocity with which motion capture would see the robot go from `pose`, where it heads
// `ahead`, to `seen`.
void WriteVelocity(const double *pose, const Direction &ahead, const double *seen, double dt_s,
                   double *out)
{
    const double turn = seen[2] - pose[2];
    const auto [c, s] = ahead.Turned(Direction::Of(turn / 2));
    const double x = (seen[0] - pose[0]) / dt_s, y = (seen[1] - pose[1]) / dt_s;
    const double velocity[3] = {c * x + s * y, c * y - s * x, turn / dt_s};
    for (size_t k = 0; k < 3; ++k)
        out[k] = std::isfinite(velocity[k]) ? velocity[k] : 0;
}

}  // namespace

std::vector<double> PredictVelocities(const std::vector<Model> &models, const Track &track,
                                      std::span<const int64_t> poses)
{
    const std::vector<size_t> usable = Needed(track, Usable(track), poses);
    const std::vector<size_t> before = BeforeEach(track, usable);
    const Headings headings(track, usable);
    std::vector<double> velocities(3 * models.size() * poses.size(), 0.0);
    if (models.empty())
        return velocities;
    const auto first = std::make_shared<const DriveChain>(models[0]);
    const std::vector<Sample> usual = MeasuredAt(*first, track, usable);
    Recordings own;
    Recordings &recordings = track.recordings ? *track.recordings : own;
    const auto predict = [&](size_t b) {
        const auto robot = b == 0 ? first : std::make_shared<const DriveChain>(models[b]);
        const DriveChain &chain = *robot;
        std::vector<Sample> other;
        if (!chain.IsSeenAs(*first))
            other = MeasuredAt(chain, track, usable);
        const std::vector<Sample> &measured = other.empty() ? usual : other;
        const auto plan = PlanOf(track, chain, measured, nullptr, recordings);
        const auto recording = RecordingOf(robot, plan, b == 0, recordings);
        RobotState state = chain.Start({});
        const auto go = [&](size_t event, Course course) {
            const std::vector<size_t> &reached = recording->plan->reached;
            Move(chain, *recording, event > 0 ? reached[event - 1] : 0, reached[event], course,
                 state);
            return course.pose();
        };
        size_t next = 0;  // event, where effects remember the way there
        for (size_t i = 0; i < poses.size(); ++i)
        {
            const auto pose = static_cast<size_t>(poses[i]);
            const size_t from = before.at(pose);
            if (from == SIZE_MAX)
                continue;
            for (; chain.RemembersOnGround() && next <= from; ++next)
                go(next, next > 0 ? headings.From(next - 1, measured[next - 1].pose) : Course({}));
            next = from + 2;
            const Pose2 reached = go(from + 1, headings.From(from, measured[from].pose));
            double seen[3];
            WriteSeen(chain, reached, seen);
            WriteVelocity(&track.pose[3 * usable[from]], headings.Ahead(from), seen,
                          track.pose_t_s[pose] - track.pose_t_s[usable[from]],
                          &velocities[3 * (b * poses.size() + i)]);
        }
    };
    predict(0);
    InParallel(models.size() - 1, [&](size_t b) { predict(b + 1); });
    return velocities;
}

}  // namespace twin

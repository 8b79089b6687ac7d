// SPDX-License-Identifier: Apache-2.0
// Velocities of one step for many models: those whose wheels move alike share one recording.
#include <algorithm>
#include <cmath>
#include <string_view>

#include "recording.h"
#include "samples.h"

namespace twin
{
namespace
{

bool IsOfFloor(std::string_view stage)
{
    return stage == "ground" || stage == "observe";
}

// Whether the wheels of both move alike, but for the times of poses.
bool DriveAlike(const Model &a, const Model &b)
{
    const auto driving = [](const Model &model) {
        std::vector<Parameter> parameters = model.Parameters();
        std::erase_if(parameters, [](const Parameter &p) { return IsOfFloor(p.stage); });
        return parameters;
    };
    const auto texts = [](const Model &model) {
        std::vector<std::string> all;
        for (const EffectInstance &effect : model.effects)
            if (!IsOfFloor(effect.stage))
                all.insert(all.end(), effect.texts.begin(), effect.texts.end());
        return all;
    };
    return texts(a) == texts(b) &&
           std::ranges::equal(driving(a), driving(b), [](const Parameter &p, const Parameter &q) {
               return p.name == q.name && p.value == q.value;
           });
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

// The mean velocity with which motion capture would see the robot go from `pose` to `seen`.
void WriteVelocity(const double *pose, const double *seen, double dt_s, double *out)
{
    const double turn = seen[2] - pose[2], middle = pose[2] + turn / 2;
    const double c = std::cos(middle), s = std::sin(middle);
    const double x = (seen[0] - pose[0]) / dt_s, y = (seen[1] - pose[1]) / dt_s;
    const double velocity[3] = {c * x + s * y, c * y - s * x, turn / dt_s};
    for (size_t k = 0; k < 3; ++k)
        out[k] = std::isfinite(velocity[k]) ? velocity[k] : 0;
}

}  // namespace

std::vector<double> PredictVelocities(const std::vector<Model> &models, const Track &track,
                                      std::span<const int64_t> poses)
{
    std::vector<size_t> usable;
    for (size_t k = 0; k < track.segment.size(); ++k)
        if (track.segment[k] >= 0)
            usable.push_back(k);
    const std::vector<size_t> before = BeforeEach(track, usable);
    std::vector<double> velocities(3 * models.size() * poses.size(), 0.0);
    const auto predict = [&](size_t b, const Recording *known, bool alike) {
        const DriveChain chain(models[b]);
        std::vector<Sample> measured;
        measured.reserve(usable.size());
        for (const size_t k : usable)
            measured.push_back(Measured(chain, track, k));
        const auto plan = PlanOf(track, measured, known ? known->plan : nullptr);
        const bool shared = alike && plan == known->plan;
        Recording own = shared ? Recording{} : Record(chain, plan);
        const Recording &recording = shared ? *known : own;
        RobotState state = chain.Start({});
        const auto go = [&](size_t event, const Pose2 &start) {
            Course course(start);
            const std::vector<size_t> &reached = recording.plan->reached;
            Move(chain, recording, event > 0 ? reached[event - 1] : 0, reached[event], course,
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
                go(next, next > 0 ? measured[next - 1].pose : Pose2{});
            next = from + 2;
            const Pose2 reached = go(from + 1, measured[from].pose);
            double seen[3];
            WriteSeen(chain, reached, seen);
            WriteVelocity(&track.pose[3 * usable[from]], seen,
                          track.pose_t_s[pose] - track.pose_t_s[usable[from]],
                          &velocities[3 * (b * poses.size() + i)]);
        }
        return own;
    };
    if (models.empty())
        return velocities;
    const Recording first = predict(0, nullptr, false);
    InParallel(models.size() - 1,
               [&](size_t b) { predict(b + 1, &first, DriveAlike(models[b + 1], models[0])); });
    return velocities;
}

}  // namespace twin

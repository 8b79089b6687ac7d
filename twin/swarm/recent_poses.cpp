// SPDX-License-Identifier: Apache-2.0
#include "swarm/recent_poses.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>

namespace twin
{
namespace
{

constexpr double kGrid_s = 0.05;
constexpr int kWindow = 200;  // times: 10 s
constexpr int kHalf = 4;      // times before and after that a velocity is fitted to
constexpr double kKept_s = kGrid_s * (kWindow + 2 * kHalf) + 1;
constexpr double kStill_radps = 0.03;  // below this a measured turn is noise

// The kept pose at a time between two of them.
Pose2 Between(const std::deque<RecentPoses::Sample> &samples, double t_s)
{
    const auto later = [](const RecentPoses::Sample &s, double t) { return s.t_s < t; };
    auto b = std::lower_bound(samples.begin(), samples.end(), t_s, later);
    if (b == samples.begin())
        return b->pose;
    b = b == samples.end() ? std::prev(b) : b;
    const auto a = std::prev(b);
    const double part = (t_s - a->t_s) / (b->t_s - a->t_s);
    return {std::lerp(a->pose.x_m, b->pose.x_m, part), std::lerp(a->pose.y_m, b->pose.y_m, part),
            std::lerp(a->pose.theta_rad, b->pose.theta_rad, part)};
}

// Derivative at `at` steps from the middle of the parabola through 2 kHalf + 1 values, a step
// apart.
double Slope(const std::vector<Pose2> &poses, size_t middle, int at, double Pose2::*value)
{
    constexpr int kPoints = 2 * kHalf + 1;
    constexpr double kSquares = kHalf * (kHalf + 1) * kPoints / 3.0;  // sum of k^2
    constexpr double kFourths = kSquares * (3 * kHalf * kHalf + 3 * kHalf - 1) / 5.0;
    double linear = 0, bent = 0;
    for (int k = -kHalf; k <= kHalf; ++k)
    {
        const double x = poses[middle + static_cast<size_t>(kHalf + k) - kHalf].*value;
        linear += k * x;
        bent += (k * k - kSquares / kPoints) * x;
    }
    return linear / kSquares + 2 * at * bent / (kFourths - kSquares * kSquares / kPoints);
}

RobotState StateAt(const std::vector<Pose2> &poses, size_t k)
{
    const size_t middle = std::clamp(k, size_t{kHalf}, poses.size() - 1 - kHalf);
    const int at = static_cast<int>(k) - static_cast<int>(middle);
    const auto rate = [&](double Pose2::*value) {
        return Slope(poses, middle, at, value) / kGrid_s;
    };
    const double x = rate(&Pose2::x_m), y = rate(&Pose2::y_m), turn = rate(&Pose2::theta_rad);
    const double c = std::cos(poses[k].theta_rad), s = std::sin(poses[k].theta_rad);
    RobotState state{};
    state.pose = poses[k];
    state.vx_mps = c * x + s * y;
    state.vy_mps = c * y - s * x;
    state.omega_radps = std::abs(turn) < kStill_radps ? 0 : turn;
    return state;
}

}  // namespace

void RecentPoses::Add(int robot, double t_s, const Pose2 &pose)
{
    Track &track = tracks_[static_cast<size_t>(robot)];
    Pose2 next = pose;
    if (track.samples.empty())
        track.first_s = t_s;
    else
    {
        const double last_rad = track.samples.back().pose.theta_rad;
        next.theta_rad = last_rad + std::remainder(pose.theta_rad - last_rad, 2 * std::numbers::pi);
    }
    track.samples.push_back({t_s, next});
    while (track.samples.front().t_s < t_s - kKept_s)
        track.samples.pop_front();
}

Metrics RecentPoses::Mean(const Ring &ring, const MetricScale &scale) const
{
    double first_s = -std::numeric_limits<double>::infinity(), last_s = -first_s;
    for (const Track &track : tracks_)
    {
        first_s = std::max(first_s, track.first_s);
        last_s = std::min(last_s, track.samples.empty() ? first_s : track.samples.back().t_s);
    }
    const int count = std::max(0, static_cast<int>(std::ceil((last_s - first_s) / kGrid_s)));
    MetricWindow window(std::numeric_limits<double>::infinity());
    if (count <= 2 * kHalf)
        return window.Mean();
    // Times at even distances from the first; those before the window only shape its velocities.
    const int begin = std::max(0, count - kWindow), from = std::max(0, begin - kHalf);
    std::vector<std::vector<Pose2>> poses(tracks_.size());
    for (size_t i = 0; i < tracks_.size(); ++i)
        for (int k = from; k < count; ++k)
            poses[i].push_back(Between(tracks_[ring.order[i]].samples, first_s + k * kGrid_s));
    std::vector<RobotState> states(tracks_.size());
    for (int k = begin; k < count; ++k)
    {
        for (size_t i = 0; i < states.size(); ++i)
            states[i] = StateAt(poses[i], static_cast<size_t>(k - from));
        window.Add(k * kGrid_s, Measure(states, ring.size, scale));
    }
    return window.Mean();
}

}  // namespace twin

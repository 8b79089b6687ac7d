// SPDX-License-Identifier: Apache-2.0
#include "swarm/metrics.h"

#include <cmath>
#include <limits>
#include <vector>

#include "swarm/metrics_lanes.h"

namespace twin
{
namespace
{

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double Metrics::*kAll[] = {
    &Metrics::circliness, &Metrics::radius_m,  &Metrics::scatter_m2, &Metrics::rotation,
    &Metrics::odd_ratio,  &Metrics::diffusion, &Metrics::groups,     &Metrics::contacts};

// The robots as columns of one lane, with room for scratch.
class Columns
{
public:
    explicit Columns(std::span<const RobotState> robots) : n_(robots.size()), values_(kCount * n_)
    {
        for (size_t i = 0; i < n_; ++i)
        {
            const RobotState &r = robots[i];
            const Motion motion = MotionOf(r.vx_mps, r.vy_mps, r.omega_radps);
            const double row[]{r.pose.x_m,
                               r.pose.y_m,
                               std::cos(r.pose.theta_rad),
                               std::sin(r.pose.theta_rad),
                               motion[kTravelX],
                               motion[kTravelY],
                               motion[kTurnX],
                               motion[kTurnY]};
            for (size_t column = 0; column < std::size(row); ++column)
                values_[column * n_ + i] = row[column];
        }
    }
    Lanes<1>::Real *At(size_t column)
    {
        return reinterpret_cast<Lanes<1>::Real *>(values_.data() + column * n_);
    }

private:
    static constexpr size_t kCount = 11;
    size_t n_;
    std::vector<double> values_;
};

}  // namespace

Motion MotionOf(double vx_mps, double vy_mps, double omega_radps)
{
    static_assert(std::tuple_size<Motion>() == kMotion);
    const double speed_mps = std::hypot(vx_mps, vy_mps);
    Motion motion{};
    if (speed_mps > 0)
        motion = {vx_mps / speed_mps, vy_mps / speed_mps, 0, 0};
    if (omega_radps != 0)
    {
        motion[kTurnX] = -vy_mps / omega_radps;
        motion[kTurnY] = vx_mps / omega_radps;
    }
    return motion;
}

Metrics Measure(std::span<const RobotState> robots, size_t ring_size, const MetricScale &scale)
{
    Columns at(robots);
    const auto m = MetricFormulas<1>::Measure(
        {static_cast<int>(robots.size()), static_cast<int>(ring_size), at.At(0), at.At(1), at.At(2),
         at.At(3), at.At(4), at.At(8), at.At(9), at.At(10), Lanes<1>::All(scale.range_m),
         2 * scale.body_radius_m * kTouch});
    return {m.circliness[0], m.radius_m[0],  m.scatter_m2[0], m.rotation[0],
            m.odd_ratio[0],  m.diffusion[0], m.groups[0],     m.contacts[0]};
}

void MetricWindow::Add(double t_s, const Metrics &metrics)
{
    kept_.emplace_back(t_s, metrics);
    while (kept_.front().first <= t_s - window_s_)
        kept_.pop_front();
}

Metrics MetricWindow::Mean() const
{
    Metrics mean;
    for (const auto field : kAll)
    {
        for (const auto &[t_s, metrics] : kept_)
            mean.*field += metrics.*field;
        mean.*field = kept_.empty() ? kNaN : mean.*field / static_cast<double>(kept_.size());
    }
    return mean;
}

const char *Classify(const Metrics &mean)
{
    if (std::isnan(mean.circliness))
        return "undefined";
    if (mean.circliness < 0.2)
        return std::abs(mean.rotation) > 0.9 && mean.contacts < 0.5 ? "milling" : "jammed";
    if (mean.circliness < 1)
        return "ellipsoidal";
    return mean.groups < 1.5 ? "cluster" : "separated";
}

}  // namespace twin

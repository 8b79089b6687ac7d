// SPDX-License-Identifier: Apache-2.0
#include "swarm/metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

namespace twin
{
namespace
{

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kTouch = 1.02;  // times the diameter
constexpr double Metrics::*kAll[] = {
    &Metrics::circliness, &Metrics::radius_m,  &Metrics::scatter_m2, &Metrics::rotation,
    &Metrics::odd_ratio,  &Metrics::diffusion, &Metrics::groups,     &Metrics::contacts};

struct Vec
{
    double x, y;
};

Vec VelocityInWorld(const RobotState &robot)
{
    const double c = std::cos(robot.pose.theta_rad), s = std::sin(robot.pose.theta_rad);
    return {c * robot.vx_mps - s * robot.vy_mps, s * robot.vx_mps + c * robot.vy_mps};
}

Vec TurningCentre(const RobotState &robot)
{
    if (robot.omega_radps == 0)
        return {robot.pose.x_m, robot.pose.y_m};
    const Vec u = VelocityInWorld(robot);
    return {robot.pose.x_m - u.y / robot.omega_radps, robot.pose.y_m + u.x / robot.omega_radps};
}

// Metrics of the ring about its centroid.
void MeasureRing(std::span<const RobotState> ring, std::span<const RobotState> odd,
                 Metrics &metrics)
{
    const double n = static_cast<double>(ring.size());
    Vec mean{0, 0};
    for (const RobotState &robot : ring)
        mean = {mean.x + robot.pose.x_m / n, mean.y + robot.pose.y_m / n};
    double least_m = std::numeric_limits<double>::infinity(), most_m = 0;
    for (const RobotState &robot : ring)
    {
        const Vec r{robot.pose.x_m - mean.x, robot.pose.y_m - mean.y}, u = VelocityInWorld(robot);
        const double radius_m = std::hypot(r.x, r.y), speed_mps = std::hypot(u.x, u.y);
        least_m = std::min(least_m, radius_m);
        most_m = std::max(most_m, radius_m);
        metrics.radius_m += radius_m / n;
        metrics.scatter_m2 += radius_m * radius_m / n;
        if (radius_m > 0 && speed_mps > 0)
            metrics.rotation += (r.x * u.y - r.y * u.x) / (radius_m * speed_mps) / n;
    }
    metrics.circliness = most_m > 0 ? (most_m - least_m) / least_m : kNaN;
    metrics.odd_ratio = odd.empty() ? kNaN : 0;
    for (const RobotState &robot : odd)
        metrics.odd_ratio += std::hypot(robot.pose.x_m - mean.x, robot.pose.y_m - mean.y) /
                             metrics.radius_m / static_cast<double>(odd.size());
}

// Metrics of pairs; groups by union of the robots that see each other.
void MeasurePairs(std::span<const RobotState> robots, const MetricScale &scale, Metrics &metrics)
{
    std::vector<size_t> group(robots.size());
    std::iota(group.begin(), group.end(), size_t{0});
    const auto root = [&group](size_t i) {
        while (group[i] != i)
            i = group[i];
        return i;
    };
    std::vector<Vec> centres;
    for (const RobotState &robot : robots)
        centres.push_back(TurningCentre(robot));
    metrics.groups = static_cast<double>(robots.size());
    double nearest_m = robots.size() > 1 ? std::numeric_limits<double>::infinity() : kNaN;
    for (size_t i = 0; i < robots.size(); ++i)
        for (size_t j = i + 1; j < robots.size(); ++j)
        {
            const Pose2 &a = robots[i].pose, &b = robots[j].pose;
            const double distance_m = std::hypot(a.x_m - b.x_m, a.y_m - b.y_m);
            metrics.contacts += distance_m < 2 * scale.body_radius_m * kTouch;
            nearest_m = std::min(
                nearest_m, std::hypot(centres[i].x - centres[j].x, centres[i].y - centres[j].y));
            if (distance_m < scale.range_m && root(i) != root(j))
            {
                group[root(i)] = root(j);
                metrics.groups -= 1;
            }
        }
    metrics.diffusion = nearest_m / scale.range_m;
}

}  // namespace

Metrics Measure(std::span<const RobotState> robots, size_t ring_size, const MetricScale &scale)
{
    Metrics metrics;
    MeasureRing(robots.first(ring_size), robots.subspan(ring_size), metrics);
    MeasurePairs(robots, scale, metrics);
    return metrics;
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

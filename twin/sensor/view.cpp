// SPDX-License-Identifier: Apache-2.0
#include "sensor/view.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sensor/view_lanes.h"

namespace twin
{
namespace
{

// Where another robot is, as the camera sees it.
struct Place
{
    double distance_m, bearing_rad;
};

Place PlaceOf(const Pose2 &eye, const Pose2 &other, const DetectionModel &detection)
{
    const double dx_m = other.x_m - eye.x_m, dy_m = other.y_m - eye.y_m;
    return {std::hypot(dx_m, dy_m),
            std::remainder(std::atan2(dy_m, dx_m) - eye.theta_rad - detection.pan_rad,
                           2 * std::numbers::pi)};
}

// Probability that `margin`, known to a standard deviation `std`, is above zero. `scale` is that of
// a logistic edge that is there besides.
double Inside(double margin, double std, double scale = 0)
{
    const double all = std::hypot(std * std::numbers::sqrt3 / std::numbers::pi, scale);
    return all > 0 ? 1 / (1 + std::exp(-margin / all)) : margin > 0;
}

double HalfWidth(double radius_m, double distance_m)
{
    return radius_m > 0 ? std::asin(std::min(1.0, radius_m / distance_m)) : 0;
}

// Probability that a body at `other` hides a target at `target`.
double Hides(const Place &other, const Place &target, const DetectionModel &detection,
             const Blur &blur)
{
    if (!(other.distance_m < target.distance_m))
        return 0;
    const double apart_rad =
        std::abs(std::remainder(other.bearing_rad - target.bearing_rad, 2 * std::numbers::pi));
    return Inside(HalfWidth(detection.hide_radius_m, other.distance_m) - apart_rad,
                  std::numbers::sqrt2 * blur.position_m / std::max(other.distance_m, 1e-3));
}

// Probability that nothing hides `target` from `self`.
double Clear(std::span<const Pose2> poses, size_t self, size_t target,
             const DetectionModel &detection, const Blur &blur)
{
    if (detection.hide_radius_m == 0)
        return 1;
    const Place place = PlaceOf(poses[self], poses[target], detection);
    double clear = 1;
    for (size_t k = 0; k < poses.size(); ++k)
        if (k != self && k != target)
            clear *= 1 - Hides(PlaceOf(poses[self], poses[k], detection), place, detection, blur);
    return clear;
}

double InViewProbability(const Pose2 &eye, const Pose2 &target, const DetectionModel &detection,
                         const Blur &blur)
{
    if (blur.position_m == 0 && blur.heading_rad == 0 && detection.softness_m == 0)
        return InView(eye, target, detection);
    const Place place = PlaceOf(eye, target, detection);
    const double both_m = std::numbers::sqrt2 * blur.position_m;
    const double half_rad =
        detection.cone_rad / 2 + HalfWidth(detection.target_radius_m, place.distance_m);
    return Inside(detection.range_m - place.distance_m, both_m, detection.softness_m) *
           Inside(half_rad - std::abs(place.bearing_rad),
                  std::hypot(blur.heading_rad, both_m / std::max(place.distance_m, 1e-3)));
}

}  // namespace

bool InView(const Pose2 &eye, const Pose2 &target, const DetectionModel &detection)
{
    const double dx_m = target.x_m - eye.x_m, dy_m = target.y_m - eye.y_m;
    const double distance2 = dx_m * dx_m + dy_m * dy_m;
    if (!(distance2 < detection.range_m * detection.range_m))
        return false;
    // The cone is symmetric: the target in the half plane left of its axis.
    const double axis_rad = eye.theta_rad + detection.pan_rad;
    const double c = std::cos(axis_rad), s = std::sin(axis_rad);
    const double ahead_m = c * dx_m + s * dy_m, aside_m = std::abs(c * dy_m - s * dx_m);
    const double cos_half = std::cos(detection.cone_rad / 2),
                 sin_half = std::sin(detection.cone_rad / 2);
    const bool inside = ahead_m > cos_half * std::sqrt(distance2);
    if (inside || detection.target_radius_m == 0)
        return inside;
    // Outside: the nearest point of the cone lies on its edge, or is its tip.
    const double along_m = std::max(ahead_m * cos_half + aside_m * sin_half, 0.0);
    return std::hypot(ahead_m - along_m * cos_half, aside_m - along_m * sin_half) <
           detection.target_radius_m;
}

bool Hidden(std::span<const Pose2> poses, size_t self, size_t target,
            const DetectionModel &detection)
{
    return Clear(poses, self, target, detection, {}) == 0;
}

std::optional<Eigen::Vector2d> PartInView(const Pose2 &eye, const Capsule &body,
                                          const DetectionModel &detection)
{
    using L = Lanes<1>;
    const double axis_rad = eye.theta_rad + detection.pan_rad;
    const EyeLanes<1> lanes{{L::All(eye.x_m), L::All(eye.y_m)},
                            L::All(std::cos(axis_rad)),
                            L::All(std::sin(axis_rad)),
                            L::All(std::cos(detection.cone_rad / 2)),
                            L::All(std::sin(detection.cone_rad / 2)),
                            L::All(detection.range_m)};
    const auto part = ViewFormulas<1>::PartInView(lanes, PlainOf(body));
    if (!part.in_view[0])
        return std::nullopt;
    return Eigen::Vector2d{part.at.x_m[0], part.at.y_m[0]};
}

double ViewProbability(std::span<const Pose2> poses, size_t self, const DetectionModel &detection,
                       const Blur &blur, std::span<const char> shown)
{
    double unseen = 1;
    for (size_t i = 0; i < poses.size() && unseen > 0; ++i)
    {
        if (i == self || std::isnan(poses[i].x_m) || !(shown.empty() || shown[i]))
            continue;
        const double seen = InViewProbability(poses[self], poses[i], detection, blur);
        if (seen > 0)
            unseen *= 1 - seen * Clear(poses, self, i, detection, blur);
    }
    return 1 - unseen;
}

DetectionModel InSector(DetectionModel detection, fw_sector sector)
{
    if (sector != FW_SECTOR_ALL)
    {
        detection.pan_rad += (sector == FW_SECTOR_LEFT ? 1 : -1) * detection.cone_rad / 4;
        detection.cone_rad /= 2;
    }
    return detection;
}

}  // namespace twin

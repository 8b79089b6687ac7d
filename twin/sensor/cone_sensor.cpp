// SPDX-License-Identifier: Apache-2.0
#include "sensor/cone_sensor.h"

#include <algorithm>
#include <cmath>

namespace twin
{

bool InView(const Pose2 &eye, const Pose2 &target, const Sensor &sensor)
{
    const double dx_m = target.x_m - eye.x_m, dy_m = target.y_m - eye.y_m;
    const double distance2 = dx_m * dx_m + dy_m * dy_m;
    if (!(distance2 < sensor.range_m * sensor.range_m))
        return false;
    // The cone is symmetric: the target in the half plane left of the heading.
    const double c = std::cos(eye.theta_rad), s = std::sin(eye.theta_rad);
    const double ahead_m = c * dx_m + s * dy_m, aside_m = std::abs(c * dy_m - s * dx_m);
    const double cos_half = std::cos(sensor.cone_rad / 2), sin_half = std::sin(sensor.cone_rad / 2);
    const bool inside = ahead_m > cos_half * std::sqrt(distance2);
    if (inside || sensor.target_radius_m == 0)
        return inside;
    // Outside: the nearest point of the cone lies on its edge, or is its tip.
    const double along_m = std::max(ahead_m * cos_half + aside_m * sin_half, 0.0);
    return std::hypot(ahead_m - along_m * cos_half, aside_m - along_m * sin_half) <
           sensor.target_radius_m;
}

ConeSensor::ConeSensor(const Sensor &sensor, int robot, uint64_t seed)
    : sensor_(sensor),
      self_(static_cast<size_t>(robot)),
      random_(seed, robot, "sensor"),
      delay_us_(std::llround(sensor.delay_s * 1e6))
{
}

std::optional<SensorFrame> ConeSensor::Expose(std::span<const Pose2> poses, int64_t utime_us)
{
    bool detected = false;
    for (size_t i = 0; i < poses.size() && !detected; ++i)
        detected = i != self_ && InView(poses[self_], poses[i], sensor_);
    // One draw per frame whatever is seen, so that streams of two runs stay in step.
    const double chance = random_.Uniform();
    if (chance < (detected ? sensor_.false_negative_rate : sensor_.false_positive_rate))
        detected = !detected;
    on_the_way_.push_back({detected, seq_++, utime_us});

    std::optional<SensorFrame> newest;
    while (!on_the_way_.empty() && on_the_way_.front().utime_us + delay_us_ <= utime_us)
    {
        newest = on_the_way_.front();
        on_the_way_.pop_front();
    }
    return newest;
}

}  // namespace twin

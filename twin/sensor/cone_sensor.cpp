// SPDX-License-Identifier: Apache-2.0
#include "sensor/cone_sensor.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace twin
{

namespace
{

// Whether a solid body, `but` apart, is between the robot that looks and a point.
bool HiddenByBody(const Sight &sight, const Eigen::Vector2d &point_m, const SeenBody *but)
{
    const Pose2 &eye = sight.poses[sight.self];
    return std::ranges::any_of(sight.bodies, [&](const SeenBody &body) {
        return &body != but && body.is_solid && Crosses(body.shape, {eye.x_m, eye.y_m}, point_m);
    });
}

}  // namespace

ConeSensor::ConeSensor(const DetectionModel &detection, std::span<const fw_bit> bits, int robot,
                       uint64_t seed)
    : detection_(detection),
      random_(seed, robot, "sensor"),
      age_us_(std::llround(detection.age_s * 1e6)),
      delay_us_(std::llround(detection.delay_s * 1e6))
{
    for (const fw_bit &bit : bits)
        eyes_.push_back({bit.box, InSector(detection, static_cast<fw_sector>(bit.sector))});
}

// One draw a bit and frame whatever is seen, two with a soft edge, so that streams of two runs stay
// in step.
bool ConeSensor::Sees(const Eye &eye, const Sight &sight)
{
    shown_.resize(sight.poses.size());
    for (size_t i = 0; i < shown_.size(); ++i)
        shown_[i] = IsInside(sight.colours.empty() ? TargetColour() : sight.colours[i], eye.box) &&
                    !HiddenByBody(sight, {sight.poses[i].x_m, sight.poses[i].y_m}, nullptr);
    const double sure = SeesBody(eye, sight)
                            ? 1
                            : ViewProbability(sight.poses, sight.self, eye.detection, {}, shown_);
    const bool in_view = detection_.softness_m > 0 ? random_.Uniform() < sure : sure > 0;
    const bool errs = random_.Uniform() < (in_view ? detection_.miss_rate : detection_.false_rate);
    return in_view != errs;
}

bool ConeSensor::SeesBody(const Eye &eye, const Sight &sight) const
{
    return std::ranges::any_of(sight.bodies, [&](const SeenBody &body) {
        if (!body.colour || !IsInside(*body.colour, eye.box))
            return false;
        const auto part_m = PartInView(sight.poses[sight.self], body.shape, eye.detection);
        return part_m && !HiddenByBody(sight, *part_m, &body);
    });
}

double ConeSensor::ReachM() const
{
    return detection_.softness_m > 0 ? std::numeric_limits<double>::infinity() : detection_.range_m;
}

std::optional<SensorFrame> ConeSensor::Next(const Sight &sight, int64_t utime_us)
{
    uint32_t bits = 0;
    for (size_t i = 0; i < eyes_.size(); ++i)
        bits |= static_cast<uint32_t>(Sees(eyes_[i], sight)) << i;
    on_the_way_.push_back({bits, seq_++, utime_us + age_us_});
    std::optional<SensorFrame> newest;
    while (!on_the_way_.empty() && on_the_way_.front().utime_us + delay_us_ <= utime_us)
    {
        newest = on_the_way_.front();
        on_the_way_.pop_front();
    }
    return newest;
}

void ConeSensor::Expose(const Sight &sight, int64_t now_us)
{
    arrived_ = Next(sight, now_us);
}

void ConeSensor::Decide(int64_t now_us, fw_ctx &firmware, fw_output &out)
{
    if (arrived_)
        fw_step_bits(&firmware, arrived_->bits, arrived_->utime_us, arrived_->seq, now_us, &out);
    else
        fw_step(&firmware, nullptr, now_us, &out);
}

}  // namespace twin

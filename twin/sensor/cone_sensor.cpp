// SPDX-License-Identifier: Apache-2.0
#include "sensor/cone_sensor.h"

#include <cmath>
#include <limits>

namespace twin
{

ConeSensor::ConeSensor(const DetectionModel &detection, int robot, uint64_t seed)
    : detection_(detection),
      random_(seed, robot, "sensor"),
      age_us_(std::llround(detection.age_s * 1e6)),
      delay_us_(std::llround(detection.delay_s * 1e6))
{
}

// One draw per frame whatever is seen, two with a soft edge, so that streams of two runs stay in
// step.
bool ConeSensor::Seen(std::span<const Pose2> poses, size_t self)
{
    const double sure = ViewProbability(poses, self, detection_, {});
    const bool in_view = detection_.softness_m > 0 ? random_.Uniform() < sure : sure > 0;
    const bool errs = random_.Uniform() < (in_view ? detection_.miss_rate : detection_.false_rate);
    return in_view != errs;
}

double ConeSensor::ReachM() const
{
    return detection_.softness_m > 0 ? std::numeric_limits<double>::infinity() : detection_.range_m;
}

std::optional<SensorFrame> ConeSensor::Next(std::span<const Pose2> poses, size_t self,
                                            int64_t utime_us)
{
    on_the_way_.push_back({Seen(poses, self), seq_++, utime_us + age_us_});
    std::optional<SensorFrame> newest;
    while (!on_the_way_.empty() && on_the_way_.front().utime_us + delay_us_ <= utime_us)
    {
        newest = on_the_way_.front();
        on_the_way_.pop_front();
    }
    return newest;
}

void ConeSensor::Expose(std::span<const Pose2> poses, size_t self, int64_t now_us)
{
    arrived_ = Next(poses, self, now_us);
}

void ConeSensor::Decide(int64_t now_us, fw_ctx &firmware, fw_output &out)
{
    if (arrived_)
        fw_step_bit(&firmware, arrived_->detected, arrived_->utime_us, arrived_->seq, now_us, &out);
    else
        fw_step(&firmware, nullptr, now_us, &out);
}

}  // namespace twin

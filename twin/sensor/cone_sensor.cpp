// SPDX-License-Identifier: Apache-2.0
#include "sensor/cone_sensor.h"

#include <cmath>
#include <limits>

namespace twin
{

ConeSensor::ConeSensor(const Sight &sight, int robot, uint64_t seed)
    : sight_(sight),
      random_(seed, robot, "sensor"),
      age_us_(std::llround(sight.age_s * 1e6)),
      delay_us_(std::llround(sight.delay_s * 1e6))
{
}

// One draw per frame whatever is seen, two with a soft edge, so that streams of two runs stay in
// step.
bool ConeSensor::Seen(std::span<const Pose2> poses, size_t self)
{
    const double sure = ViewProbability(poses, self, sight_, {});
    const bool in_view = sight_.softness_m > 0 ? random_.Uniform() < sure : sure > 0;
    const bool errs = random_.Uniform() < (in_view ? sight_.miss_rate : sight_.false_rate);
    return in_view != errs;
}

double ConeSensor::ReachM() const
{
    return sight_.softness_m > 0 ? std::numeric_limits<double>::infinity() : sight_.range_m;
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

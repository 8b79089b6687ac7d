// SPDX-License-Identifier: Apache-2.0
#include "swarm/camera_sensor.h"

#include <cmath>

namespace twin
{

CameraSensor::CameraSensor(const CameraWorld &world, int robot, const DetectionModel &detection,
                           uint64_t seed)
    : scenes_(world, robot, detection, seed),
      camera_(scenes_.settings(), robot, seed),
      age_us_(std::llround(detection.age_s * 1e6)),
      delay_us_(std::llround(detection.delay_s * 1e6))
{
}

void CameraSensor::Expose(const Sight &sight, int64_t now_us)
{
    on_the_way_.push_back({{sight.poses.begin(), sight.poses.end()},
                           {sight.colours.begin(), sight.colours.end()},
                           {sight.bodies.begin(), sight.bodies.end()},
                           sight.self,
                           now_us + age_us_,
                           seq_++});
    arrived_.reset();
    while (!on_the_way_.empty() && on_the_way_.front().utime_us + delay_us_ <= now_us)
    {
        arrived_ = std::move(on_the_way_.front());
        on_the_way_.pop_front();
    }
}

std::optional<fw_frame> CameraSensor::DrawArrived()
{
    if (!arrived_)
        return std::nullopt;
    frame_ = camera_.Draw(
        scenes_.Next({arrived_->poses, arrived_->self, arrived_->colours, arrived_->bodies}),
        arrived_->poses[arrived_->self]);
    fw_frame frame{};
    frame.yuyv = frame_.data();
    frame.width_px = scenes_.settings().width_px;
    frame.height_px = scenes_.settings().height_px;
    frame.stride_bytes = 2 * frame.width_px;
    frame.utime_us = arrived_->utime_us;
    frame.seq = arrived_->seq;
    frame.length_bytes = frame_.size();
    return frame;
}

void CameraSensor::Decide(int64_t now_us, fw_ctx &firmware, fw_output &out)
{
    const std::optional<fw_frame> frame = DrawArrived();
    fw_step(&firmware, frame ? &*frame : nullptr, now_us, &out);
}

}  // namespace twin

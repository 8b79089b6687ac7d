// SPDX-License-Identifier: Apache-2.0
#include "swarm/camera_eye.h"

#include <cmath>

namespace twin
{

CameraEye::CameraEye(const CameraWorld &world, int robot, const Sight &sight, uint64_t seed)
    : self_(static_cast<size_t>(robot)),
      sightings_(world, robot, sight, seed),
      camera_(sightings_.settings(), robot, seed),
      age_us_(std::llround(sight.age_s * 1e6)),
      delay_us_(std::llround(sight.delay_s * 1e6))
{
}

std::optional<fw_frame> CameraEye::NextFrame(std::span<const Pose2> poses, int64_t now_us)
{
    on_the_way_.push_back({{poses.begin(), poses.end()}, now_us + age_us_, seq_++});
    std::optional<Exposure> due;
    while (!on_the_way_.empty() && on_the_way_.front().utime_us + delay_us_ <= now_us)
    {
        due = std::move(on_the_way_.front());
        on_the_way_.pop_front();
    }
    if (!due)
        return std::nullopt;
    frame_ = camera_.Draw(sightings_.Next(due->poses), due->poses[self_]);
    fw_frame frame{};
    frame.yuyv = frame_.data();
    frame.width_px = sightings_.settings().width_px;
    frame.height_px = sightings_.settings().height_px;
    frame.stride_bytes = 2 * frame.width_px;
    frame.utime_us = due->utime_us;
    frame.seq = due->seq;
    frame.length_bytes = frame_.size();
    return frame;
}

void CameraEye::Decide(std::span<const Pose2> poses, int64_t now_us, fw_ctx &firmware,
                       fw_output &out)
{
    const std::optional<fw_frame> frame = NextFrame(poses, now_us);
    fw_step(&firmware, frame ? &*frame : nullptr, now_us, &out);
}

}  // namespace twin

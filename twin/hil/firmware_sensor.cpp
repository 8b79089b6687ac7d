// SPDX-License-Identifier: Apache-2.0
#include "hil/firmware_sensor.h"

#include <cmath>
#include <cstring>

#include "process.h"

namespace twin
{

FirmwareSensor::FirmwareSensor(const FirmwareOptions &options, const CameraWorld &world, int robot,
                               const DetectionModel &detection, uint64_t seed)
    : CameraSensor(world, robot, detection, seed),
      options_(options),
      camera_(world.settings),
      robot_(robot),
      vote_frames_(static_cast<int>(std::lround(detection.vote_frames))),
      process_(std::make_unique<Process>(options_, camera_, robot_, vote_frames_))
{
}

FirmwareSensor::~FirmwareSensor() = default;

void FirmwareSensor::Select(const fw_behavior &behavior)
{
    options_.behavior = behavior.name;
    options_.table = behavior.table;
    process_.reset();
    process_ = std::make_unique<Process>(options_, camera_, robot_, vote_frames_);
    for (const std::vector<uint8_t> &frame : recent_)
    {
        process_->Send(frame);
        process_->Receive(true);
    }
}

void FirmwareSensor::Show(std::span<const uint8_t> frame)
{
    if (recent_.size() == static_cast<size_t>(vote_frames_))
        recent_.pop_front();
    recent_.emplace_back(frame.begin(), frame.end());
    process_->Send(frame);
}

void FirmwareSensor::Decide(int64_t now_us, fw_ctx &firmware, fw_output &out)
{
    const std::optional<fw_frame> frame = DrawArrived();
    fw_step(&firmware, frame ? &*frame : nullptr, now_us, &out);
    if (frame)
        Show({frame->yuyv, frame->length_bytes});
    process_->Receive(options_.lockstep);
    // A robot that an operator holds stands, though its program does not know.
    if (out.mode == FW_MODE_TABLE)
        std::memcpy(out.wheel_duty_pct, process_->wheel_duty_pct().data(),
                    sizeof out.wheel_duty_pct);
}

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "hil/firmware_eye.h"

#include <cmath>
#include <cstring>

#include "process.h"

namespace twin
{

FirmwareEye::FirmwareEye(const FirmwareOptions &options, const CameraWorld &world, int robot,
                         const Sight &sight, uint64_t seed)
    : CameraEye(world, robot, sight, seed),
      process_(std::make_unique<Process>(options, world.settings, robot,
                                         static_cast<int>(std::lround(sight.vote_frames)))),
      lockstep_(options.lockstep)
{
}

FirmwareEye::~FirmwareEye() = default;

void FirmwareEye::Decide(std::span<const Pose2> poses, int64_t now_us, fw_ctx &firmware,
                         fw_output &out)
{
    const std::optional<fw_frame> frame = NextFrame(poses, now_us);
    fw_step(&firmware, frame ? &*frame : nullptr, now_us, &out);
    if (frame)
        process_->Send({frame->yuyv, frame->length_bytes});
    process_->Receive(lockstep_);
    // A robot that an operator holds stands, though its program does not know.
    if (out.mode == FW_MODE_TABLE)
        std::memcpy(out.wheel_duty_pct, process_->wheel_duty_pct().data(),
                    sizeof out.wheel_duty_pct);
}

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
// The robot's program as a process, and the socket to it.
#ifndef HIL_PROCESS_H
#define HIL_PROCESS_H

#include <sys/types.h>

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "fw/mixing.h"
#include "hil/firmware_sensor.h"

namespace twin
{

class FirmwareSensor::Process
{
public:
    Process(const FirmwareOptions &options, const CameraSettings &camera, int robot,
            int vote_frames);
    ~Process();
    Process(const Process &) = delete;

    void Send(std::span<const uint8_t> frame);
    // Reads answers: all there are, or until that to the frame sent last.
    void Receive(bool wait_for_last);
    const std::array<int8_t, FW_WHEEL_COUNT> &wheel_duty_pct() const { return wheel_duty_pct_; }

private:
    void Start(const FirmwareOptions &options, const CameraSettings &camera, int robot,
               int vote_frames);
    void Accept();
    void End();
    [[noreturn]] void Fail(const std::string &what) const;

    std::string name_, folder_;
    int listener_ = -1, connection_ = -1;
    pid_t pid_ = -1;
    uint32_t sent_ = 0, answered_ = 0;
    std::array<int8_t, FW_WHEEL_COUNT> wheel_duty_pct_{};
};

}  // namespace twin

#endif

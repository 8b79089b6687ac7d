// SPDX-License-Identifier: Apache-2.0
// Hardware in the loop: a robot of the swarm whose decisions the robot's own program makes. It runs
// as a process with a stub camera, to which the twin sends what it draws, and a stub board, whose
// bytes drive the wheels.
#ifndef HIL_FIRMWARE_SENSOR_H
#define HIL_FIRMWARE_SENSOR_H

#include <deque>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "fw/table.h"
#include "swarm/camera_sensor.h"

namespace twin
{

struct FirmwareOptions
{
    std::string program;  // turbopi
    std::string behavior;
    fw_table table;                 // of that behaviour, which the program need not have built in
    std::vector<std::string> bits;  // as the program's configuration has them
    // Waits for the answer to each frame: same seed, same run. Else takes the newest answer there
    // is, as the wheels of a robot would.
    bool lockstep = true;
};

class FirmwareSensor final : public CameraSensor
{
public:
    // Starts the program. Throws std::runtime_error in one sentence if it does not come up.
    FirmwareSensor(const FirmwareOptions &options, const CameraWorld &world, int robot,
                   const DetectionModel &detection, uint64_t seed);
    ~FirmwareSensor() override;

    // All but the duties is what the built-in firmware says of the same frame. Throws
    // std::runtime_error if the program is gone or silent.
    void Decide(int64_t now_us, fw_ctx &firmware, fw_output &out) override;
    // Starts the program anew with that behaviour, and shows it the frames that its vote is about:
    // it then decides as one that was told while it ran.
    void Select(const fw_behavior &behavior) override;

private:
    class Process;
    void Show(std::span<const uint8_t> frame);

    FirmwareOptions options_;
    CameraSettings camera_;
    int robot_, vote_frames_;
    std::unique_ptr<Process> process_;
    std::deque<std::vector<uint8_t>> recent_;
};

}  // namespace twin

#endif

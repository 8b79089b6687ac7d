// SPDX-License-Identifier: Apache-2.0
// A drawn camera whose frames go through the firmware's own threshold.
#ifndef SWARM_CAMERA_SENSOR_H
#define SWARM_CAMERA_SENSOR_H

#include <deque>
#include <optional>
#include <vector>

#include "sensor/camera.h"
#include "sensor/robot_sensor.h"
#include "swarm/camera_scenes.h"

namespace twin
{

class CameraSensor : public RobotSensor
{
public:
    // `detection` by CameraDetectionModel(): a frame's time stamp is age_s after its exposure, and
    // it reaches the firmware delay_s after that. The rest is in the pixels.
    CameraSensor(const CameraWorld &world, int robot, const DetectionModel &detection,
                 uint64_t seed);

    void Expose(const Sight &sight, int64_t now_us) override;
    void Decide(int64_t now_us, fw_ctx &firmware, fw_output &out) override;
    Image LastImage() const override
    {
        return {frame_, scenes_.settings().width_px, scenes_.settings().height_px};
    }

protected:
    // Draws the frame that arrived by the last Expose(); none if no further one did.
    std::optional<fw_frame> DrawArrived();

private:
    struct Exposure
    {
        std::vector<Pose2> poses;
        std::vector<Colour> colours;
        std::vector<SeenBody> bodies;
        size_t self;
        int64_t utime_us;  // time stamp
        uint32_t seq;
    };
    CameraScenes scenes_;
    Camera camera_;
    int64_t age_us_, delay_us_;
    uint32_t seq_ = 0;
    std::deque<Exposure> on_the_way_;
    std::optional<Exposure> arrived_;
    std::vector<uint8_t> frame_;
};

}  // namespace twin

#endif

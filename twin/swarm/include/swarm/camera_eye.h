// SPDX-License-Identifier: Apache-2.0
// A drawn camera whose frames go through the firmware's own threshold.
#ifndef SWARM_CAMERA_EYE_H
#define SWARM_CAMERA_EYE_H

#include <deque>
#include <optional>
#include <vector>

#include "sensor/camera.h"
#include "swarm/camera_sight.h"
#include "swarm/eye.h"

namespace twin
{

class CameraEye : public Eye
{
public:
    // `sight` by CameraSight(): a frame's time stamp is age_s after its exposure, and it reaches
    // the firmware delay_s after that. The rest is in the pixels.
    CameraEye(const CameraWorld &world, int robot, const Sight &sight, uint64_t seed);

    void Decide(std::span<const Pose2> poses, int64_t now_us, fw_ctx &firmware,
                fw_output &out) override;

    Picture LastPicture() const override
    {
        return {frame_, sightings_.settings().width_px, sightings_.settings().height_px};
    }

protected:
    // Exposes at every call. Draws the newest frame that is due; none if no further one is.
    std::optional<fw_frame> NextFrame(std::span<const Pose2> poses, int64_t now_us);

private:
    struct Exposure
    {
        std::vector<Pose2> poses;
        int64_t utime_us;  // time stamp
        uint32_t seq;
    };
    size_t self_;
    CameraSightings sightings_;
    Camera camera_;
    int64_t age_us_, delay_us_;
    uint32_t seq_ = 0;
    std::deque<Exposure> on_the_way_;
    std::vector<uint8_t> frame_;
};

}  // namespace twin

#endif

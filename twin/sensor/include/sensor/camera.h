// SPDX-License-Identifier: Apache-2.0
// A robot's camera: draws what it sees into frames like the real one's, without a graphics card.
#ifndef SENSOR_CAMERA_H
#define SENSOR_CAMERA_H

#include <memory>
#include <vector>

#include "plant/random.h"
#include "sensor/lens.h"
#include "sensor/scene.h"

namespace twin
{

struct CameraSettings
{
    int width_px = 640, height_px = 480;
    Lens lens;
    // Place on the robot, as in turbopi.xml; looks ahead, but left by the pan and down by the tilt.
    double forward_m = 0.073, height_m = 0.125, pan_rad = 0, tilt_rad = 0;
    // Brightness differs by this from robot to robot, and from frame to frame (assumed).
    double exposure_std = 0.05, flicker_std = 0.01;
    // White noise of each byte (assumed).
    double luma_std = 3, chroma_std = 1.5;
};

class Camera
{
public:
    // Noise is the same for the same seed and robot.
    Camera(const CameraSettings &settings, int robot, uint64_t seed);
    ~Camera();
    Camera(Camera &&) noexcept;

    // Rows of YUYV (two bytes a pixel) without padding, kept until the next frame. A pixel is what
    // the ray through its middle meets; two neighbours share the mean of their colours.
    const std::vector<uint8_t> &Draw(const Scene &scene, const Pose2 &robot);

private:
    class Canvas;
    void Expose(std::vector<uint8_t> &yuyv);

    CameraSettings settings_;
    std::unique_ptr<Canvas> canvas_;
    Random random_;
    double exposure_;
    std::vector<int8_t> noise_;
    std::vector<uint8_t> frame_;
};

}  // namespace twin

#endif

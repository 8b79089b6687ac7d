// SPDX-License-Identifier: Apache-2.0
#include "sensor/camera.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "canvas.h"

namespace twin
{
namespace
{

constexpr size_t kNoiseBytes = 65536;

void CheckSettings(const CameraSettings &s)
{
    if (s.width_px < 2 || s.width_px % 2 != 0 || s.height_px < 1)
        throw std::invalid_argument("camera: a frame of " + std::to_string(s.width_px) + " x " +
                                    std::to_string(s.height_px) +
                                    " pixels: the width must be even, both above zero");
}

Eigen::Matrix3d Turn(double yaw_rad)
{
    const double c = std::cos(yaw_rad), s = std::sin(yaw_rad);
    return Eigen::Matrix3d{{c, -s, 0}, {s, c, 0}, {0, 0, 1}};
}

// From the camera's axes to the robot's: it looks left by the pan, then down by the tilt.
Eigen::Matrix3d CameraToBody(double pan_rad, double tilt_rad)
{
    const double c = std::cos(tilt_rad), s = std::sin(tilt_rad);
    return Turn(pan_rad) * Eigen::Matrix3d{{c, 0, s}, {0, 1, 0}, {-s, 0, c}};
}

// `value` times gain_256 / 256 about `zero`, plus noise, within what BT.601 allows.
uint8_t Exposed(int value, int zero, int gain_256, int noise)
{
    const int scaled = zero + (((value - zero) * gain_256 + 128) >> 8) + noise;
    return static_cast<uint8_t>(std::clamp(scaled, 1, 254));
}

}  // namespace

Camera::Camera(const CameraSettings &settings, int robot, uint64_t seed)
    : settings_((CheckSettings(settings), settings)),
      canvas_(std::make_unique<Canvas>(settings)),
      random_(seed, robot, "camera"),
      exposure_(1 + settings.exposure_std * random_.Normal())
{
    // Luma and chroma by turns, as in a frame; one row more than a random start may skip.
    const size_t row_bytes = 2 * static_cast<size_t>(settings.width_px);
    for (size_t i = 0; i < kNoiseBytes + row_bytes; ++i)
    {
        const double std = i % 2 ? settings.chroma_std : settings.luma_std;
        noise_.push_back(
            static_cast<int8_t>(std::lround(std::clamp(std * random_.Normal(), -127.0, 127.0))));
    }
}

Camera::~Camera() = default;
Camera::Camera(Camera &&) noexcept = default;

const std::vector<uint8_t> &Camera::Draw(const Scene &scene, const Pose2 &robot)
{
    const Eigen::Matrix3d body_to_world = Turn(robot.theta_rad);
    const Eigen::Matrix3d world_to_camera =
        (body_to_world * CameraToBody(settings_.pan_rad, settings_.tilt_rad)).transpose();
    const Eigen::Vector3d eye_m =
        Eigen::Vector3d(robot.x_m, robot.y_m, 0) +
        body_to_world * Eigen::Vector3d(settings_.forward_m, 0, settings_.height_m);
    for (const Box &box : scene.boxes)
        canvas_->DrawBox(world_to_camera * (box.centre_m - eye_m),
                         world_to_camera * Turn(box.yaw_rad), box.half_m, box.colour);
    for (const Ball &ball : scene.balls)
        canvas_->DrawBall(world_to_camera * (ball.centre_m - eye_m), ball.radius_m, ball.colour);
    canvas_->Finish(frame_);
    Expose(frame_);
    return frame_;
}

// Each byte times the exposure, about black or grey, plus noise that starts anywhere in its table.
void Camera::Expose(std::vector<uint8_t> &yuyv)
{
    const double gain = exposure_ * (1 + settings_.flicker_std * random_.Normal());
    const int gain_256 = static_cast<int>(std::lround(256 * std::clamp(gain, 0.0, 8.0)));
    const size_t row_bytes = 2 * static_cast<size_t>(settings_.width_px);
    for (size_t begin = 0; begin < yuyv.size(); begin += row_bytes)
    {
        const int8_t *noise = &noise_[static_cast<size_t>(random_.Uniform() * kNoiseBytes / 4) * 4];
        uint8_t *row = &yuyv[begin];
        for (size_t i = 0; i < row_bytes; i += 2)
        {
            row[i] = Exposed(row[i], 16, gain_256, noise[i]);
            row[i + 1] = Exposed(row[i + 1], 128, gain_256, noise[i + 1]);
        }
    }
}

}  // namespace twin

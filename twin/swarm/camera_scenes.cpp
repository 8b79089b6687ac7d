// SPDX-License-Identifier: Apache-2.0
#include "swarm/camera_scenes.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <stdexcept>
#include <string>

#include "fw/bit.h"
#include "sensor/view.h"

namespace twin
{
namespace
{

constexpr double kPi = std::numbers::pi;
constexpr double kWidest_rad = 2.8;  // of a picture: beyond, a lens shows next to nothing more
constexpr double kFalseTargetAt_m = 0.04, kFalseTargetLimits = 2;

double LimitPx()
{
    return fw_bit_default().min_blob_px;
}

// As far as a target covers more than the firmware's limit.
double OwnRange(const CameraWorld &world)
{
    return world.settings.lens.focal_px * std::sqrt(TargetArea(world.target) / LimitPx());
}

double OwnCone(const CameraSettings &settings)
{
    return 2 * settings.lens.AngleRad(settings.width_px / 2.0 / settings.lens.focal_px);
}

void CheckDetectionModel(const DetectionModel &detection)
{
    if (detection.cone_rad > kWidest_rad)
        throw std::invalid_argument(
            "the model's effects make a camera's view " +
            std::to_string(std::lround(detection.cone_rad * 180 / kPi)) +
            " degrees wide, and a picture can show 160: lower view_angle.factor, or use "
            "--sensor cone");
    if (detection.miss_rate + detection.false_rate > 1)
        throw std::invalid_argument(
            "the model's effects let a camera miss targets at a rate of " +
            std::to_string(detection.miss_rate) + " and imagine them at " +
            std::to_string(detection.false_rate) +
            ": above 1 together, which no picture can show; lower missed_detection.rate or "
            "false_detection.rate, or use --sensor cone");
}

CameraSettings SettingsFor(CameraSettings settings, const DetectionModel &detection)
{
    settings.pan_rad += detection.pan_rad;
    if (detection.cone_rad != OwnCone(settings))
        settings.lens.focal_px =
            settings.width_px / 2.0 / settings.lens.Radius(detection.cone_rad / 2);
    return settings;
}

}  // namespace

DetectionModel CameraDetectionModel(const Model &robot, const CameraWorld &world)
{
    Model model = robot;
    model.sensor.range_m = OwnRange(world);
    model.sensor.cone_rad = OwnCone(world.settings);
    model.sensor.false_negative_rate = model.sensor.false_positive_rate = 0;
    const DetectionModel detection = model.MakeDetectionModel();
    CheckDetectionModel(detection);
    return detection;
}

CameraScenes::CameraScenes(const CameraWorld &world, int robot, const DetectionModel &detection,
                           uint64_t seed)
    : world_(world),
      self_(static_cast<size_t>(robot)),
      detection_(detection),
      settings_(SettingsFor(world.settings, detection)),
      own_range_m_(OwnRange(world)),
      scale_of_lens_(world.settings.lens.focal_px / settings_.lens.focal_px),
      random_(seed, robot, "camera_scenes")
{
}

// One draw whatever is seen, if the edge is soft.
double CameraScenes::TargetScale(std::span<const Pose2> poses, size_t target)
{
    double range_m = detection_.range_m;
    if (detection_.softness_m > 0)
    {
        const double u = random_.Uniform();
        range_m = std::max(0.0, range_m + detection_.softness_m * std::log(u / (1 - u)));
    }
    const bool hidden = target != self_ && Hidden(poses, self_, target, detection_);
    return hidden ? 0 : range_m / own_range_m_ * scale_of_lens_;
}

// On the camera's axis, nearer than any other robot can come.
Ball CameraScenes::FalseTarget(const Pose2 &pose) const
{
    const double c = std::cos(pose.theta_rad), s = std::sin(pose.theta_rad);
    const double yaw_rad = pose.theta_rad + settings_.pan_rad;
    const double level = std::cos(settings_.tilt_rad);
    const Eigen::Vector3d eye_m(pose.x_m + c * settings_.forward_m,
                                pose.y_m + s * settings_.forward_m, settings_.height_m);
    const Eigen::Vector3d axis(level * std::cos(yaw_rad), level * std::sin(yaw_rad),
                               -std::sin(settings_.tilt_rad));
    const double radius_px = std::sqrt(kFalseTargetLimits * LimitPx() / kPi);
    return {eye_m + kFalseTargetAt_m * axis, kFalseTargetAt_m * radius_px / settings_.lens.focal_px,
            TargetColour()};
}

Scene CameraScenes::Next(const Sight &sight)
{
    const std::span<const Pose2> poses = sight.poses;
    const double u = random_.Uniform();
    const bool misses = u >= 1 - detection_.miss_rate, imagines = u < detection_.false_rate;
    scales_.resize(poses.size());
    for (size_t i = 0; i < poses.size(); ++i)
        scales_[i] = TargetScale(poses, i) * !misses;
    Scene scene = RobotsSeenBy(self_, poses, world_.target, scales_, sight.colours);
    scene.balls.insert(scene.balls.end(), world_.distractors.begin(), world_.distractors.end());
    for (const SeenBody &body : sight.bodies)
        std::ranges::copy(BoxesOf(body, poses[self_]), std::back_inserter(scene.boxes));
    if (imagines)
        scene.balls.push_back(FalseTarget(poses[self_]));
    return scene;
}

}  // namespace twin

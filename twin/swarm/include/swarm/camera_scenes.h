// SPDX-License-Identifier: Apache-2.0
// The effects of view and decide in drawn frames. All act in the picture, so that the firmware's
// threshold, built in or in a program of its own, finds what the effect says.
#ifndef SWARM_CAMERA_SCENES_H
#define SWARM_CAMERA_SCENES_H

#include <span>
#include <vector>

#include "model_file/model.h"
#include "plant/random.h"
#include "sensor/camera.h"
#include "sensor/robot_sensor.h"

namespace twin
{

// What all cameras of a swarm share.
struct CameraWorld
{
    Target target = Target::kBall;
    std::vector<Ball> distractors;
    CameraSettings settings;
};

// What such a camera sees by itself, without errors, changed by the effects of `robot`. Of the
// model's [sensor], which describes the cone, it takes delay and vote alone. Throws
// std::invalid_argument in one sentence if no picture can show what the effects ask for.
DetectionModel CameraDetectionModel(const Model &robot, const CameraWorld &world);

// Draws what camera `robot` is given to see, by CameraDetectionModel:
// pan      the camera is turned;
// cone     a lens of another focal length, and targets that keep their size in the picture;
// range    more or less of a target has its colour, so that it fills the firmware's limit at that
// range;
//          a soft edge draws the range anew for each target and frame;
// hiding   a target behind a body of that radius is not drawn;
// misses   no target is drawn; false detections: a green spot twice the limit in the middle.
class CameraScenes
{
public:
    CameraScenes(const CameraWorld &world, int robot, const DetectionModel &detection,
                 uint64_t seed);

    const CameraSettings &settings() const { return settings_; }
    Scene Next(const Sight &sight);

private:
    double TargetScale(std::span<const Pose2> poses, size_t target);
    Ball FalseTarget(const Pose2 &pose) const;

    CameraWorld world_;
    size_t self_;
    DetectionModel detection_;
    CameraSettings settings_;
    double own_range_m_, scale_of_lens_;
    Random random_;
    std::vector<double> scales_;
};

}  // namespace twin

#endif

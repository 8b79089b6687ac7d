// SPDX-License-Identifier: Apache-2.0
// The camera as geometry: whether another robot is in a cone ahead, from poses that are exact or
// measured.
#ifndef SENSOR_VIEW_H
#define SENSOR_VIEW_H

#include <optional>
#include <span>

#include "effects/effect.h"
#include "fw/bit.h"
#include "plant/plant.h"
#include "plant/world_body.h"

namespace twin
{

// Whether `eye` sees `target`: its centre strictly within range_m, and strictly within half of
// cone_rad of the heading turned by pan_rad. A target_radius_m above zero: any part of that disc
// may be in the cone. Edges are sharp, and nothing hides the target.
bool InView(const Pose2 &eye, const Pose2 &target, const DetectionModel &detection);

// Whether the body of another robot, of hide_radius_m, hides robot `target` from `self`.
bool Hidden(std::span<const Pose2> poses, size_t self, size_t target,
            const DetectionModel &detection);

// The point of the body's segment from which its nearest part is in view: nearer than range_m, and
// within half of cone_rad of the heading turned by pan_rad, with sharp edges. None: no part is.
// Cones of up to 180 degrees.
std::optional<Eigen::Vector2d> PartInView(const Pose2 &eye, const Capsule &body,
                                          const DetectionModel &detection);

// How well poses are known: standard deviations. All zero: exactly.
struct Blur
{
    double position_m = 0, heading_rad = 0;
};

// Probability, 0 to 1, that robot `self` has at least one other in view; misses and false
// detections apart. With exact poses and a sharp range it is 0 or 1. Blurred edges are logistic,
// with the variance of the pose noise that they stand for. A pose of NaN is seen by nobody.
// `shown`, one per robot, leaves out those with another target than is looked for: they hide, and
// are not seen.
double ViewProbability(std::span<const Pose2> poses, size_t self, const DetectionModel &detection,
                       const Blur &blur, std::span<const char> shown = {});

// What a bit of that sector sees: half of a cone is a cone about another axis.
DetectionModel InSector(DetectionModel detection, fw_sector sector);

}  // namespace twin

#endif

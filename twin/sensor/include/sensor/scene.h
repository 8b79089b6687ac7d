// SPDX-License-Identifier: Apache-2.0
// What there is to see: robots as boxes and balls, and things of other colours.
#ifndef SENSOR_SCENE_H
#define SENSOR_SCENE_H

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fw/threshold.h"
#include "plant/plant.h"
#include "plant/world_body.h"

namespace twin
{

// BT.601, studio range, as cameras send it.
struct Colour
{
    uint8_t y, u, v;
    // From red, green and blue in [0, 1], without gamma of its own (ITU-R BT.601-7, 2.5).
    static Colour FromRgb(double red, double green, double blue);
    bool operator==(const Colour &) const = default;
};

// As the firmware's threshold does.
bool IsInside(const Colour &colour, const fw_color_box &box);

struct Ball
{
    Eigen::Vector3d centre_m;
    double radius_m;
    Colour colour;
};

// Turned about the vertical alone: robots stand on a level floor.
struct Box
{
    Eigen::Vector3d centre_m, half_m;
    double yaw_rad;
    Colour colour;
};

struct Scene
{
    std::vector<Ball> balls;
    std::vector<Box> boxes;
};

// The green thing on a robot that others look for.
enum class Target
{
    kBall,  // on a mast, as in turbopi.xml
    kCover  // a box over the upper deck
};

// Mean area of a target as seen from its own height, in m^2.
double TargetArea(Target target);
Colour TargetColour();
// Of a target: green, red, blue, orange or purple. Throws std::invalid_argument in one sentence.
Colour ColourNamed(const std::string &name);

// What robot `self` may see of all the robots: the rest of them, sizes as in turbopi.xml.
// `target_scales`, one per robot, enlarge or shrink their targets; 0: none. Without: 1. `colours`
// are those of the targets. Without: TargetColour().
Scene RobotsSeenBy(size_t self, std::span<const Pose2> poses, Target target,
                   std::span<const double> target_scales = {},
                   std::span<const Colour> colours = {});

// A body of the world when a frame is exposed.
struct SeenBody
{
    Capsule shape;
    double height_m;
    std::optional<Colour> colour;  // none: no bit sees it, and it is drawn grey
    bool is_solid;
};

// As `eye` sees it: a disc as a plate across the line of sight, as wide as its outline; of a wall
// the posts at its ends, and a box between them.
std::vector<Box> BoxesOf(const SeenBody &body, const Pose2 &eye);

// Coloured balls, none of them green, that lie on the floor in a ring about the origin.
std::vector<Ball> Distractors(int count, double ring_radius_m, uint64_t seed);

}  // namespace twin

#endif

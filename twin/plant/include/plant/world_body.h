// SPDX-License-Identifier: Apache-2.0
// Bodies of the world that are seen and in the way, and that obey nobody: obstacles, walls, goals,
// evaders.
#ifndef PLANT_WORLD_BODY_H
#define PLANT_WORLD_BODY_H

#include <Eigen/Core>
#include <string>
#include <vector>

#include "plant/capsule_lanes.h"

namespace twin
{

// What a body covers of the floor: all that is nearer than radius_m to a segment. A disc's segment
// is a point; a wall's is as long as the wall.
struct Capsule
{
    Eigen::Vector2d from_m, to_m;
    double radius_m;
    bool operator==(const Capsule &) const = default;
};
PlainCapsule PlainOf(const Capsule &capsule);

// The point of the segment that is nearest to `point_m`.
Eigen::Vector2d NearestPoint(const Capsule &capsule, const Eigen::Vector2d &point_m);
// Whether the straight way from `a_m` to `b_m` goes through it.
bool Crosses(const Capsule &capsule, const Eigen::Vector2d &a_m, const Eigen::Vector2d &b_m);

struct WorldBody
{
    std::string name;
    Capsule shape;         // at the start
    double height_m;       // above the floor
    std::string colour;    // for the cameras' bits; empty: none sees it
    bool is_solid = true;  // stops robots, and hides what is behind it
    // Where from_m goes from its place, straight from point to point and back to its place, again
    // and again. Empty: it stands.
    std::vector<Eigen::Vector2d> path_m{};
    double speed_mps = 0;

    bool Moves() const { return !path_m.empty() && speed_mps > 0; }
    Capsule At(double t_s) const;
    bool operator==(const WorldBody &) const = default;
};

}  // namespace twin

#endif

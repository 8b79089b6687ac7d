// SPDX-License-Identifier: Apache-2.0
// Where the robots of a swarm start.
#ifndef SWARM_STARTS_H
#define SWARM_STARTS_H

#include <cstdint>
#include <span>
#include <vector>

#include "plant/plant.h"
#include "plant/world_body.h"

namespace twin
{

enum class StartShape
{
    kSquare,     // uniform in a square of side spread_m, random headings
    kDisc,       // uniform in a disc of diameter spread_m, random headings
    kFacingOut,  // as the authors start: packed in a disc of radius 2 N body / (2 pi) + 0.1 m with
                 // body = 0.2 m, centres at least a body apart, facing away from the middle
};

// n poses whose bodies do not overlap each other or the solid ones of `world`, around the origin.
// Throws std::invalid_argument in one sentence if that many bodies do not fit.
std::vector<Pose2> StartPoses(StartShape shape, int n, double spread_m, double body_radius_m,
                              uint64_t seed, std::span<const WorldBody> world = {});

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// The planar plant with round bodies that push each other apart.
#ifndef SWARM_BODIES_H
#define SWARM_BODIES_H

#include "plant/planar_plant.h"

namespace twin
{

// Moves overlapping discs apart along the line between them, each by half of the overlap, all at
// once from the same positions. `radius_m` of 0: no bodies.
void PushApart(std::vector<Pose2> &poses, double radius_m);

class PlanarBodies final : public PlanarPlant
{
public:
    // As PlanarPlant; all bodies have the first model's body_radius_m.
    PlanarBodies(const std::vector<Model> &models, const std::vector<Pose2> &starts, uint64_t seed);
    void Step(double dt_s) override;

private:
    double radius_m_;
    std::vector<Pose2> poses_;
};

}  // namespace twin

#endif

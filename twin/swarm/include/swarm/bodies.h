// SPDX-License-Identifier: Apache-2.0
// The planar plant with round bodies that push each other apart.
#ifndef SWARM_BODIES_H
#define SWARM_BODIES_H

#include "plant/planar_plant.h"
#include "swarm/cell_grid.h"

namespace twin
{

// Moves overlapping discs apart along the line between them, each by half of the overlap, all at
// once from the same positions. With friction, what they moved past each other since `before` is
// taken back, up to the larger coefficient times the overlap (Macklin et al. 2014). One body per
// pose; radii of 0: no bodies.
// `grid`: none, or one to find neighbours with; the result is the same to the bit.
void PushApart(std::vector<Pose2> &poses, const std::vector<Pose2> &before,
               const std::vector<Body> &bodies, CellGrid *grid = nullptr);

class PlanarBodies final : public PlanarPlant
{
public:
    // As PlanarPlant; each model gives its robot's body (Model::MakeBody).
    PlanarBodies(const std::vector<Model> &models, const std::vector<Pose2> &starts, uint64_t seed,
                 size_t grid_from = kGridPays);
    void Step(double dt_s) override;

private:
    std::vector<Body> bodies_;
    bool touch_ = false;
    std::vector<Pose2> before_, poses_;
    CellGrid grid_;
    size_t grid_from_;
};

}  // namespace twin

#endif

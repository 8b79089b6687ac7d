// SPDX-License-Identifier: Apache-2.0
// The planar plant with round bodies that push each other apart.
#ifndef SWARM_BODIES_H
#define SWARM_BODIES_H

#include "plant/planar_plant.h"
#include "plant/world_body.h"
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

// Moves a disc that overlaps what does not yield, out of it; friction as above. `..._before`:
// where both were.
void PushOut(Pose2 &pose, const Pose2 &pose_before, const Body &body, const Capsule &wall,
             const Capsule &wall_before);

class PlanarBodies final : public PlanarPlant
{
public:
    // As PlanarPlant; each model gives its robot's body (Model::MakeBody). Those of `world` that
    // are solid stop robots.
    PlanarBodies(const std::vector<Model> &models, const std::vector<Pose2> &starts, uint64_t seed,
                 size_t grid_from = kGridPays, std::vector<WorldBody> world = {});
    void Step(double dt_s) override;

private:
    void StopAtWorld(double dt_s);

    std::vector<Body> bodies_;
    std::vector<WorldBody> world_;  // the solid ones
    bool touch_ = false;
    std::vector<Pose2> before_, poses_;
    CellGrid grid_;
    size_t grid_from_;
};

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// From the MJCF file of one robot to the compiled model of many on one floor.
#ifndef PLANT_MUJOCO_MUJOCO_WORLD_H
#define PLANT_MUJOCO_MUJOCO_WORLD_H

#include "plant_mujoco/mujoco_plant.h"

namespace twin
{

// Numeric of the MJCF file: drag across the grip, as a fraction of a wheel's load (0 if absent).
constexpr const char *kRollerDrag = "roller_drag";

// Bodies that stop robots: a mocap body each, in this order.
std::vector<WorldBody> SolidOf(std::vector<WorldBody> world);

// A new model, owned by the caller. Throws std::invalid_argument in one sentence.
mjModel *CompileWorld(const std::string &mjcf, const std::vector<Model> &models,
                      const std::vector<Pose2> &starts, const MujocoOptions &options);

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// The MJCF of a robot of which only the model's numbers are known: a round hull on wheels.
#ifndef PLANT_MUJOCO_ROBOT_MJCF_H
#define PLANT_MUJOCO_ROBOT_MJCF_H

#include <string>

#include "model_file/model.h"

namespace twin
{

// What geom_user[0] of a wheel says of its rollers: see mecanum_collider.h.
double RollerCode(Tread tread);

// Wheels, radius, hull and mass are the model's. Motors are as strong for their robot as a
// TurboPi's. A differential robot that states no robot.half_wheelbase_m stands on two wheels (in
// pairs) and two frictionless skids; one that does has four wheels, which scrub when it turns.
std::string RobotMjcf(const Model &model);

}  // namespace twin

#endif

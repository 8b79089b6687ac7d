// SPDX-License-Identifier: Apache-2.0
// Contact of a wheel with rollers and the floor: MuJoCo's plane-cylinder collision, replaced for
// cylinders that carry in geom_user[0] the sign of a mecanum wheel's roller axis, or
// kRollersAcrossCode.
#ifndef PLANT_MUJOCO_MECANUM_COLLIDER_H
#define PLANT_MUJOCO_MECANUM_COLLIDER_H

namespace twin
{

constexpr double kRollersAcrossCode = 2;

// For the whole process; calling it again changes nothing. Other cylinders collide as before.
void InstallMecanumCollider();

}  // namespace twin

#endif

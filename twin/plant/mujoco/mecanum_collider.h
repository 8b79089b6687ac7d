// SPDX-License-Identifier: Apache-2.0
// Contact of a mecanum wheel with the floor: MuJoCo's plane-cylinder collision, replaced for
// cylinders that carry the sign of a roller axis in geom_user[0].
#ifndef PLANT_MUJOCO_MECANUM_COLLIDER_H
#define PLANT_MUJOCO_MECANUM_COLLIDER_H

namespace twin
{

// For the whole process; calling it again changes nothing. Other cylinders collide as before.
void InstallMecanumCollider();

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
#include "mecanum_collider.h"

#include <mujoco/mujoco.h>

#include <mutex>
#include <numbers>

namespace twin
{
namespace
{

mjfCollision stock_collision = nullptr;

// One contact at the lowest point of the rim. Its first tangent is the axis of the roller there, so
// that a contact pair can grip along that axis and let go across it.
//
//   axle a, floor normal n, rolling direction t = a x n:    tangent = (t + s l) / sqrt(2)
//   l = a without its part along n, s = geom_user[0]; rollers across (omni wheels): t alone
int CollideWheel(const mjModel *m, mjData *d, mjPreContact *contact, int plane, int wheel,
                 mjtNum margin)
{
    const mjtNum side = m->nuser_geom > 0 ? m->geom_user[m->nuser_geom * wheel] : 0;
    const mjtNum *plane_R = d->geom_xmat + 9 * plane, *wheel_R = d->geom_xmat + 9 * wheel;
    const mjtNum n[3] = {plane_R[2], plane_R[5], plane_R[8]};
    const mjtNum a[3] = {wheel_R[2], wheel_R[5], wheel_R[8]};
    const mjtNum a_n = mju_dot3(a, n);

    // From the hub to the lowest point of the rim; undefined for a wheel that lies flat.
    mjtNum l[3], down[3];
    mju_addScl3(l, a, n, -a_n);
    mju_scl3(down, a, a_n);
    mju_subFrom3(down, n);
    if (side == 0 || mju_normalize3(down) < mjMINVAL || mju_normalize3(l) < mjMINVAL)
        return stock_collision(m, d, contact, plane, wheel, margin);

    mjtNum lowest[3], from_plane[3], t[3];
    mju_addScl3(lowest, d->geom_xpos + 3 * wheel, down, m->geom_size[3 * wheel]);
    mju_sub3(from_plane, lowest, d->geom_xpos + 3 * plane);
    contact->dist = mju_dot3(from_plane, n);
    if (contact->dist > margin)
        return 0;
    mju_addScl3(contact->pos, lowest, n, -contact->dist / 2);
    mju_copy3(contact->normal, n);
    mju_cross(t, a, n);
    mju_normalize3(t);
    if (side == kRollersAcrossCode)
    {
        mju_copy3(contact->tangent, t);
        return 1;
    }
    mju_addScl3(contact->tangent, t, l, side);
    mju_scl3(contact->tangent, contact->tangent, 1 / std::numbers::sqrt2);
    return 1;
}

}  // namespace

void InstallMecanumCollider()
{
    static std::once_flag once;
    std::call_once(once, [] {
        stock_collision = mjCOLLISIONFUNC[mjGEOM_PLANE][mjGEOM_CYLINDER];
        mjCOLLISIONFUNC[mjGEOM_PLANE][mjGEOM_CYLINDER] = CollideWheel;
    });
}

}  // namespace twin

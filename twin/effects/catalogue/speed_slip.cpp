// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "speed_slip",
    .drives = kAnyDrive,
    .summary =
        "The faster the robot travels, the larger the share of its speed that is lost to "
        "slip.",
    .equation = "v' = v max(0, 1 - loss |v|), v = (vx, vy)",
    .leaves_out = "slip of wheels that turn the robot on the spot",
    .measure =
        "straight drives at five or more speeds, forward and sideways; on drives in one "
        "direction speed_curve looks alike, and at one speed base.forward_gain",
    .reference = "slip linear in speed; Wong 2008, Theory of Ground Vehicles",
    .family = Family::kFriction,
    .needs = Needs::kSteadySpeed,
    .phrase = "loses more of its speed the faster it goes",
    .identify = kStraight | kStrafe | kLevels,
};

constexpr ParameterSpec kParameters[] = {
    {"loss_s_per_m", "s/m", 0, 0.2, -1, 2, "relative loss of speed per speed",
     "loses speed when fast", "gains speed when fast"},
};

void Step(GroundSignals &s, const Numbers &v, double *)
{
    const double speed_mps = std::hypot(s.vx_mps, s.vy_mps);
    const double kept = std::max(0.0, 1 - v[0] * speed_mps);
    s.vx_mps *= kept;
    s.vy_mps *= kept;
}

}  // namespace

EFFECT(speed_slip) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{Step},
};

}  // namespace twin

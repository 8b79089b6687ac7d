// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "yaw_lever",
    .drives = kAnyDrive,
    .summary = "The robot turns at another rate while it travels than on the spot.",
    .equation = "omega' = omega (1 + rise |v|), v = (vx, vy)",
    .leaves_out = "another lever at all speeds, which is base.yaw_gain's",
    .measure = "turns on the spot and arcs of several speeds; arcs of one speed show base.yaw_gain",
    .reference =
        "effective lever of wheels that slip; Mandow et al. 2007, Experimental kinematics for"
        " wheeled skid-steer mobile robots",
    .family = Family::kGeometry,
    .needs = Needs::kSteadySpeed,
    .phrase = "turns at another rate while it travels",
    .identify = kSpin | kArcs | kLevels,
};

constexpr ParameterSpec kParameters[] = {
    {"rise_s_per_m", "s/m", 0, 0.3, -2, 2, "relative rise of the turn rate per speed of travel",
     "turns faster while it travels", "turns slower while it travels"},
};

void Step(GroundSignals &s, const Numbers &v, double *)
{
    s.omega_radps *= 1 + v[0] * std::hypot(s.vx_mps, s.vy_mps);
}

}  // namespace

EFFECT(yaw_lever) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{Step},
};

}  // namespace twin

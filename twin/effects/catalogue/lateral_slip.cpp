// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "lateral_slip",
    .drives = kAnyDrive,
    .summary = "In curves the robot slips outwards.",
    .equation = "vx' = vx + slip omega vy, vy' = vy - slip omega vx",
    .leaves_out = "the limit of grip; different slip along and across the wheels",
    .measure =
        "arcs of several speeds and radii, both ways; on arcs of one speed marker_offset "
        "looks alike",
    .reference =
        "side slip proportional to the centripetal acceleration; Pacejka 2012, Tire and "
        "Vehicle Dynamics",
    .family = Family::kFriction,
    .needs = Needs::kSteadySpeed,
    .phrase = "slips outwards in curves",
    .identify = kArcs | kLevels,
};

constexpr ParameterSpec kParameters[] = {
    {"slip_s", "s", 0, 0.03, -0.5, 0.5, "outward speed per centripetal acceleration",
     "slips outwards in curves", "pulls inwards in curves"},
};

void Step(GroundSignals &s, const Numbers &v, double *)
{
    const double turn = v[0] * s.omega_radps, vx_mps = s.vx_mps;
    s.vx_mps += turn * s.vy_mps;
    s.vy_mps -= turn * vx_mps;
}

}  // namespace

EFFECT(lateral_slip) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{Step},
};

}  // namespace twin

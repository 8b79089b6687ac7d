// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "floor_tilt",
    .drives = kAnyDrive,
    .summary = "The robot creeps in one direction of the room while it moves.",
    .equation = "v_W' = v_W + drift while any wheel turns",
    .leaves_out = "dependence of the creep on speed and load",
    .measure = "the same drives along four headings",
    .reference =
        "Scheding et al. 1999, An experiment in autonomous navigation of an underground mining vehicle (slip on slopes)",
    .family = Family::kPlace,
    .needs = Needs::kRoom,
    .phrase = "creeps in one direction of the room",
    .identify = kStraight | kHeadings,
};

constexpr ParameterSpec kParameters[] = {
    {"drift_x_mps", "m/s", 0, 0.005, -0.2, 0.2, "creep along x of W",
     "creeps towards x of the room", "creeps against x of the room"},
    {"drift_y_mps", "m/s", 0, 0.005, -0.2, 0.2, "creep along y of W",
     "creeps towards y of the room", "creeps against y of the room"},
};

void Step(GroundSignals &s, const Numbers &v, double *)
{
    if (!s.moves)
        return;
    const auto [c, d] = s.AheadAfter(s.dt_s / 2);
    s.vx_mps += c * v[0] + d * v[1];
    s.vy_mps += -d * v[0] + c * v[1];
}

}  // namespace

EFFECT(floor_tilt) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{Step},
};

}  // namespace twin

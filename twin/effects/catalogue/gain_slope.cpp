// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "gain_slope",
    .drives = kAnyDrive,
    .summary = "Speed rises across the room.",
    .equation = "v' = v (1 + gx x + gy y), v = (vx, vy), (x, y) the robot's place in W",
    .leaves_out = "slopes of the turn rate; curvature",
    .measure =
        "the same drives at places two metres apart, at several headings; at one place "
        "base.forward_gain and base.sideways_gain look alike, over time battery_sag and "
        "heat_gain",
    .reference = "first-order expansion of a gain that depends on place",
    .family = Family::kPlace,
    .needs = Needs::kRoom,
    .phrase = "faster at one end of the room",
    .identify = kStraight | kPlaces | kHeadings,
};

constexpr ParameterSpec kParameters[] = {
    {"x_per_m", "1/m", 0, 0.02, -0.3, 0.3, "gx: relative rise of speed per metre along x of W",
     "faster at large x", "faster at small x"},
    {"y_per_m", "1/m", 0, 0.02, -0.3, 0.3, "gy: the same along y", "faster at large y",
     "faster at small y"},
};

// The gain grows exponentially on its own way: exact on straight lines.
void Step(GroundSignals &s, const Numbers &v, double *)
{
    const double x_per_m = v[0], y_per_m = v[1];
    const auto [c, d] = s.AheadAfter(s.dt_s / 2);
    const double rise =
        (x_per_m * (c * s.vx_mps - d * s.vy_mps) + y_per_m * (d * s.vx_mps + c * s.vy_mps)) *
        s.dt_s;
    const double mean = std::abs(rise) > 1e-9 ? std::expm1(rise) / rise : 1;
    const double factor = (1 + x_per_m * s.x_m + y_per_m * s.y_m) * mean;
    s.vx_mps *= factor;
    s.vy_mps *= factor;
}

}  // namespace

EFFECT(gain_slope) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{Step},
};

}  // namespace twin

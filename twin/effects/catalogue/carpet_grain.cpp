// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "carpet_grain",
    .drives = kAnyDrive,
    .summary = "The robot travels faster along one line of the room than across it.",
    .equation = "v' = v (1 + c2 cos(2 phi) + s2 sin(2 phi)), phi the direction of travel in W",
    .leaves_out = "a difference between there and back; sideways drift across the grain",
    .measure =
        "the same straight drive along four headings; along one heading base.forward_gain and"
        " base.sideways_gain look alike",
    .reference =
        "lowest harmonic of anisotropic friction; Zmitrowicz 1989, Mathematical descriptions "
        "of anisotropic friction",
    .family = Family::kPlace,
    .needs = Needs::kRoom,
    .phrase = "faster along one line of the room",
    .identify = kStraight | kHeadings,
};

constexpr ParameterSpec kParameters[] = {
    {"c2", "1", 0, 0.03, -0.5, 0.5, "rise of speed along x of W, and loss along y",
     "faster along x of the room", "faster along y of the room"},
    {"s2", "1", 0, 0.03, -0.5, 0.5, "rise of speed halfway between x and y of W, and loss across",
     "faster between x and y of the room", "faster across the line between x and y of the room"},
};

void Step(GroundSignals &s, const Numbers &v, double *)
{
    const double squared = s.vx_mps * s.vx_mps + s.vy_mps * s.vy_mps;
    if (squared <= 0)
        return;
    const auto [c, d] = s.AheadAfter(s.dt_s / 2);
    const double x_mps = c * s.vx_mps - d * s.vy_mps, y_mps = d * s.vx_mps + c * s.vy_mps;
    const double cos2 = (x_mps * x_mps - y_mps * y_mps) / squared;
    const double sin2 = 2 * x_mps * y_mps / squared;
    const double factor = 1 + (v[0] * cos2 + v[1] * sin2);
    s.vx_mps *= factor;
    s.vy_mps *= factor;
}

}  // namespace

EFFECT(carpet_grain) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{Step},
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "turn_asymmetry",
    .drives = kAnyDrive,
    .summary = "The robot turns faster to the left than to the right.",
    .equation = "omega' = omega + asymmetry |omega|",
    .leaves_out = "a turn while driving straight, which is wheel_gain's",
    .measure =
        "turns on the spot, both ways; turns one way show base.yaw_gain, and "
        "reverse_asymmetry looks alike on the spot",
    .reference =
        "Borenstein and Feng 1996, Measurement and correction of systematic odometry errors "
        "in mobile robots",
    .family = Family::kGain,
    .needs = Needs::kSteadySpeed,
    .phrase = "turns one way faster than the other",
    .identify = kSpin,
};

constexpr ParameterSpec kParameters[] = {
    {"asymmetry", "1", 0, 0.03, -0.5, 0.5, "relative rise of left turns, and loss of right ones",
     "turns faster to the left", "turns faster to the right"},
};

void Step(GroundSignals &s, const Numbers &v, double *)
{
    s.omega_radps += v[0] * std::abs(s.omega_radps);
}

}  // namespace

EFFECT(turn_asymmetry) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{Step},
};

}  // namespace twin

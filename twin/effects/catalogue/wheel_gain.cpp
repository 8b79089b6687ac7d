// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "wheel_gain",
    .drives = kAnyDrive,
    .summary = "Wheels differ in speed at the same duty.",
    .equation = "v_k' = v_k (1 + gain_k)",
    .leaves_out = "dependence on speed and direction; the mean of all wheels is the base gain",
    .measure = "straight drives forward and sideways, turns on the spot",
    .reference =
        "Borenstein and Feng 1996, Measurement and correction of systematic odometry errors in mobile robots",
    .family = Family::kGain,
    .needs = Needs::kSteadySpeed,
    .phrase = "wheels differ in strength",
    .identify = kStraight | kStrafe | kSpin,
    .suspect_when = kSteady,
};

constexpr ParameterSpec kParameters[] = {
    {"{wheel}", "1", 0, 0.03, -0.5, 0.5, "relative change of the {words}'s speed", "{words} strong",
     "{words} weak", 0.05},
};

void Step(WheelSignals &s, const Numbers &v, double *)
{
    for (int k = 0; k < s.robot.wheels; ++k)
        s.target_mps[k] *= 1 + v[k];
}

}  // namespace

EFFECT(wheel_gain) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnWheels{Step},
};

}  // namespace twin

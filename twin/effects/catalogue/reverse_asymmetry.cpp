// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "reverse_asymmetry",
    .drives = kAnyDrive,
    .summary =
        "Wheels that turn backwards are slower or faster than forwards, each side by its own factor.",
    .equation = "v' = v (1 + side) where v < 0; a wheel in the middle has the mean of both sides",
    .leaves_out = "differences between front and rear wheels",
    .measure = "straight drives forward and back at the same duties",
    .reference =
        "brush motors with advanced timing; seen on a TurboPi as a yaw drift that changes in reverse",
    .family = Family::kGain,
    .needs = Needs::kSteadySpeed,
    .phrase = "wheels differ in reverse",
    .identify = kStraight | kReversals,
    .suspect_when = kSteady,
};

constexpr ParameterSpec kParameters[] = {
    {"left", "1", 0, 0.03, -0.5, 0.5, "relative change of the left wheels' speed in reverse",
     "left wheels strong in reverse", "left wheels weak in reverse"},
    {"right", "1", 0, 0.03, -0.5, 0.5, "relative change of the right wheels' speed in reverse",
     "right wheels strong in reverse", "right wheels weak in reverse"},
};

// A wheel in the middle has the mean of both sides.
double Side(double left, const Numbers &v)
{
    return ((1 + left) * v[0] + (1 - left) * v[1]) / 2;
}

void Step(WheelSignals &s, const Numbers &v, double *)
{
    for (int k = 0; k < s.robot.wheels; ++k)
        if (s.target_mps[k] < 0)
            s.target_mps[k] *= 1 + Side(s.robot.left[k], v);
}

}  // namespace

EFFECT(reverse_asymmetry) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnWheels{Step},
};

}  // namespace twin

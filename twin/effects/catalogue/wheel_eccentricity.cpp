// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "wheel_eccentricity",
    .drives = kAnyDrive,
    .summary =
        "A wheel that is not round, or not centred, rolls faster and slower once in each "
        "turn.",
    .equation =
        "way = rim way (1 + cos_k cos(phi_k) + sin_k sin(phi_k)), phi_k the wheel's angle, "
        "0 where the log began that told them, found anew in any other; of wheels of radius_ratio "
        "times the model's radius",
    .leaves_out =
        "ripple of single rollers; what turns a wheel unseen: slip in a long log, a robot that is "
        "lifted or pushed",
    .measure =
        "slow straight drives of several turns of the wheels in one log; the mean over a turn"
        " is wheel_gain's",
    .reference = "instantaneous radius of an eccentric disc, to first order",
    .family = Family::kGeometry,
    .needs = Needs::kWheelAngle,
    .phrase = "a wheel is not round",
    .identify = kStraight | kLong,
};

constexpr ParameterSpec kParameters[] = {
    {"{wheel}_cos", "1", 0, 0.02, -0.3, 0.3, "{words}: relative rise of its radius at angle 0",
     "{words} larger at its starting angle", "{words} smaller at its starting angle"},
    {"{wheel}_sin", "1", 0, 0.02, -0.3, 0.3,
     "{words}: relative rise of its radius at angle 90 degrees", "{words} larger a quarter turn on",
     "{words} smaller a quarter turn on"},
    {"radius_ratio", "1", 1, 1.01, 0.8, 1.25,
     "wheels' radius over the model's, which is seldom right to a percent; the angle alone has it",
     "", "", 0.003, Role::kRadius},
};

// Mean over the step's part of a turn: exact at constant speed, second order while it changes.
void Roll(RollSignals &s, const Numbers &v, double *)
{
    const double ratio = v[2 * s.robot.wheels];
    for (int k = 0; k < s.robot.wheels; ++k)
    {
        if (v[2 * k] == 0 && v[2 * k + 1] == 0)
            continue;
        const double half_rad = s.mean_mps[k] * s.dt_s / (2 * s.robot.wheel_radius_m * ratio);
        const double chord = std::abs(half_rad) > 1e-6 ? std::sin(half_rad) / half_rad : 1;
        const double middle_rad = s.wheel_rad[k] / ratio + half_rad;
        s.radius_ratio[k] *=
            1 + chord * (v[2 * k] * std::cos(middle_rad) + v[2 * k + 1] * std::sin(middle_rad));
    }
}

}  // namespace

EFFECT(wheel_eccentricity) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnRolling{Roll},
};

}  // namespace twin

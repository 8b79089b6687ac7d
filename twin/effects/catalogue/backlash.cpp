// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "backlash",
    .drives = kAnyDrive,
    .summary = "Gears have play: a motor that turns round takes it up before its wheel moves.",
    .equation =
        "g' = w within 0 <= g <= gap, g where in the play the motor is, w the motor's speed at the "
        "wheel's axle; the wheel rests while g changes, else follows w; g = 0 at the start",
    .leaves_out =
        "a wheel that rolls on by itself in the play, and a push of the body that closes it",
    .measure = "changes from forward to back and the same with a pause between, at several speeds",
    .reference = "Nordin and Gutman 2002, Controlling mechanical systems with backlash",
    .family = Family::kTransient,
    .needs = Needs::kChanges,
    .phrase = "gears have play",
    .identify = kReversals,
};

constexpr ParameterSpec kParameters[] = {
    {"gap_rad", "rad", 0, 0.1, 0, 1.5, "angle of a wheel's axle that the play takes",
     "gears have play", "gears have no play"},
};

// Where in its play each wheel's motor is, from 0 (driving back) to the gap (driving forward).
int StateSize(const Numbers &v)
{
    return v[0] > 0 ? kMaxWheels : 0;
}

// The part of the step's turn that takes up play moves nothing. What a play before this one takes
// up does not reach it: two add.
void Roll(RollSignals &s, const Numbers &v, double *play_rad)
{
    if (v[0] <= 0)
        return;
    for (int k = 0; k < s.robot.wheels; ++k)
    {
        const double turn_rad = s.mean_mps[k] * s.radius_ratio[k] * s.dt_s / s.robot.wheel_radius_m;
        if (turn_rad == 0)
            continue;
        const double before_rad = play_rad[k];
        play_rad[k] = std::clamp(before_rad + turn_rad, 0.0, v[0]);
        s.radius_ratio[k] *= 1 - (play_rad[k] - before_rad) / turn_rad;
    }
}

}  // namespace

EFFECT(backlash) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnRolling{Roll},
    .state_size = StateSize,
    // The play is in the gears, before all that happens between wheel and floor.
    .turn = Turn::kFirst,
};

}  // namespace twin

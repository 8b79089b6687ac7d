// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "slew_limit",
    .drives = kDutyOnly,
    .summary = "The motor driver changes duty only gradually.",
    .equation = "|du'/dt| <= 1 / ramp, u' tends to u",
    .leaves_out = "different ramps up and down",
    .measure =
        "single steps of several sizes from rest, up and down; at one size motor_lag and "
        "input_delay look alike",
    .reference =
        "rate limiter as in motor drivers' acceleration ramps; Franklin et al. 2010, Feedback"
        " Control of Dynamic Systems",
    .family = Family::kTransient,
    .needs = Needs::kChanges,
    .phrase = "commands are ramped",
    .identify = kSteps | kLevels,
};

constexpr ParameterSpec kParameters[] = {
    {"ramp_s", "s", 0, 0.1, 0, 2, "time from rest to full duty; 0: no limit", "commands are ramped",
     "commands are not ramped"},
};

int StateSize(const Numbers &v)
{
    return v[0] > 0 ? 1 + 2 * kMaxWheels : 0;
}

// Over a step of a ramp that begins at `out`; `full_ramp_s` is the time from rest to full duty.
double Mean(double out, double told, double full_ramp_s, double dt_s)
{
    const double ramp_s = std::abs(told - out) * full_ramp_s;
    if (ramp_s <= dt_s)
        return told - (told - out) * ramp_s / (2 * dt_s);
    return out + std::copysign(dt_s / (2 * full_ramp_s), told - out);
}

// What the driver put out at time state[0], and what it was told then. A later effect may cut the
// step: how far the ramp got is known only when the next one begins.
void Step(DutySignals &s, const Numbers &v, double *state)
{
    const double ramp_s = v[0];
    if (ramp_s <= 0)
        return;
    const double change = std::max(0.0, s.t_s - state[0]) / ramp_s;
    state[0] = s.t_s;
    double *out = state + 1, *told = out + kMaxWheels;
    for (int k = 0; k < s.robot.wheels; ++k)
    {
        out[k] += std::clamp(told[k] - out[k], -change, change);
        told[k] = s.duty[k];
        s.duty[k] = Mean(out[k], told[k], ramp_s, s.dt_s);
    }
}

}  // namespace

EFFECT(slew_limit) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnDuty{Step},
    .state_size = StateSize,
};

}  // namespace twin

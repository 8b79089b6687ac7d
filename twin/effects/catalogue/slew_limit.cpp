// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"
#include "effects/ramp.h"

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
    return v[0] > 0 ? kRampState : 0;
}

void Step(DutySignals &s, const Numbers &v, double *state)
{
    if (v[0] > 0)
        Ramp(s, {v[0], v[0], v[0], v[0]}, state);
}

}  // namespace

EFFECT(slew_limit) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnDuty{Step},
    .state_size = StateSize,
};

}  // namespace twin

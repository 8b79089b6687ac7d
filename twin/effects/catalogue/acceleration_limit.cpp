// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"
#include "effects/ramp.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "acceleration_limit",
    .drives = static_cast<unsigned>(Drive::kTwist),
    .summary = "The robot's controller changes velocities only gradually.",
    .equation = "|dvx'/dt|, |dvy'/dt| <= 1 / pace; |domega'/dt| <= 1 / turn_pace",
    .leaves_out = "other limits for slowing down; a limit on the direction's change",
    .measure =
        "single steps of several sizes from rest, forward and turning; at one size motor_lag and "
        "input_delay look alike",
    .reference =
        "rate limiter of velocity controllers; Franklin et al. 2010, Feedback Control of Dynamic "
        "Systems, sec. 9.3",
    .family = Family::kTransient,
    .needs = Needs::kChanges,
    .phrase = "velocities are ramped",
    .identify = kSteps | kSpin,
};

constexpr ParameterSpec kParameters[] = {
    {"pace_s2_per_m", "s2/m", 0, 0.5, 0, 10,
     "time for a change by 1 m/s, 1 / acceleration; 0: no limit", "speeds are ramped",
     "speeds are not ramped"},
    {"turn_pace_s2_per_rad", "s2/rad", 0, 0.1, 0, 5,
     "time for a change by 1 rad/s, 1 / angular acceleration; 0: no limit", "turn rates are ramped",
     "turn rates are not ramped"},
};

int StateSize(const Numbers &v)
{
    return v[0] > 0 || v[1] > 0 ? kRampState : 0;
}

void Step(DutySignals &s, const Numbers &v, double *state)
{
    if (v[0] > 0 || v[1] > 0)
        Ramp(s, {v[0], v[0], v[1]}, state);
}

}  // namespace

EFFECT(acceleration_limit) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnDuty{Step},
    .state_size = StateSize,
};

}  // namespace twin

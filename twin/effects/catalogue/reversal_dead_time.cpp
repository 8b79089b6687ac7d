// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "reversal_dead_time",
    .drives = kDutyOnly | static_cast<unsigned>(Drive::kWheelSpeed),
    .summary = "A wheel told to turn the other way stands still for a while first.",
    .equation = "u' = 0 until dead_time after u left its old sign, then u' = u",
    .leaves_out = "play that has to be taken up also after a pause: time at zero duty counts here",
    .measure =
        "changes from forward straight to back, and the same with a pause between; single "
        "steps, or input_delay and motor_lag look alike",
    .reference =
        "lock-out of motor drivers; for play in gears see Nordin and Gutman 2002, Controlling"
        " mechanical systems with backlash",
    .family = Family::kTransient,
    .needs = Needs::kChanges,
    .phrase = "wheels pause before they turn the other way",
    .identify = kReversals,
};

constexpr ParameterSpec kParameters[] = {
    {"dead_time_s", "s", 0, 0.05, 0, 0.3, "from leaving one direction to the start in the other",
     "pauses before it reverses", "reverses without a pause"},
};

// Sums of steps and times that differ by rounding alone are the same time.
constexpr double kSameTime_s = 1e-9;
constexpr int kPerWheel = 3;  // sign of the last drive, whether it ended, and when

int StateSize(const Numbers &v)
{
    return v[0] > 0 ? kMaxWheels * kPerWheel : 0;
}

// One wheel's duty `u`; `state` is that wheel's.
void Hold(DutySignals &s, double dead_time_s, double &u, double *state)
{
    double &sign = state[0], &ended = state[1], &end_s = state[2];
    if (u * sign > 0)
    {
        ended = 0;
        return;
    }
    if (ended == 0)
        end_s = s.t_s;
    ended = 1;
    if (u == 0)
        return;
    const double wait_s = sign == 0 ? 0 : end_s + dead_time_s - s.t_s;
    if (wait_s > kSameTime_s)
    {
        u = 0;
        s.dt_s = std::min(s.dt_s, wait_s);
        return;
    }
    sign = u > 0 ? 1 : -1;
    ended = 0;
}

void Step(DutySignals &s, const Numbers &v, double *state)
{
    if (v[0] <= 0)
        return;
    for (int k = 0; k < s.robot.wheels; ++k)
        Hold(s, v[0], s.duty[k], state + k * kPerWheel);
}

}  // namespace

EFFECT(reversal_dead_time) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnDuty{Step},
    .state_size = StateSize,
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "input_delay",
    .drives = kAnyDrive,
    .summary = "Commands reach the wheels late.",
    .equation = "u'(t) = u(t - delay)",
    .leaves_out = "jitter of the delay",
    .measure = "steps from rest, with both clocks tied by a flash or a tap",
    .reference =
        "pure transport delay; Franklin et al. 2010, Feedback Control of Dynamic "
        "Systems, sec. 5.6",
    .family = Family::kTransient,
    .needs = Needs::kChanges,
    .phrase = "commands act late",
    .identify = kSteps,
    .suspect_when = kStarting | kChanging,
};

constexpr ParameterSpec kParameters[] = {
    {"delay_s", "s", 0, 0.02, 0, 1, "from the time stamp of a command to its effect on the motors",
     "commands act late", "commands act early", 0.2, Role::kLateness},
};

// A ring of the last commands, each with the time at which it was given. It holds a delay of 0.3 s
// at one command per 5 ms, and the longest at one per 16 ms; at more the oldest kept takes effect
// early.
constexpr int kSlots = 64;
constexpr int kSlotSize = 1 + kMaxWheels;

// Sums of steps and delays that differ by rounding alone are the same time.
constexpr double kSameTime_s = 1e-9;

int StateSize(const Numbers &v)
{
    return v[0] > 0 ? 1 + kSlots * kSlotSize : 0;
}

// The command given `age` commands ago: its time, then its values.
double *Slot(double *state, int age)
{
    const int count = static_cast<int>(state[0]);
    return state + 1 + ((count - 1 - age) % kSlots) * kSlotSize;
}

// state[0] counts the commands; a command that repeats the last one needs no slot of its own.
void Remember(const DutySignals &s, double *state)
{
    if (state[0] > 0 && std::equal(s.duty.begin(), s.duty.end(), Slot(state, 0) + 1))
        return;
    state[0] += 1;
    double *slot = Slot(state, 0);
    slot[0] = s.t_s;
    std::copy(s.duty.begin(), s.duty.end(), slot + 1);
}

void Step(DutySignals &s, const Numbers &v, double *state)
{
    const double delay_s = v[0];
    if (delay_s <= 0)
        return;
    Remember(s, state);
    const int kept = std::min(static_cast<int>(state[0]), kSlots);
    for (int age = 0; age < kept; ++age)
    {
        const double *slot = Slot(state, age);
        const double wait_s = slot[0] + delay_s - s.t_s;
        if (wait_s <= kSameTime_s || age == kSlots - 1)
        {
            std::copy_n(slot + 1, kMaxWheels, s.duty.begin());
            return;
        }
        s.dt_s = std::min(s.dt_s, wait_s);
    }
    s.duty = {};  // none has arrived yet
}

}  // namespace

EFFECT(input_delay) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnDuty{Step},
    .state_size = StateSize,
    // On commands as they were given, which change at times and not all the time: each change cuts
    // the step, and a ramp would be cut into pieces as short as the delay.
    .turn = Turn::kFirst,
};

}  // namespace twin

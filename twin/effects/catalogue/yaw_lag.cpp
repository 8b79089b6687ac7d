// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "yaw_lag",
    .drives = kDutyOnly | static_cast<unsigned>(Drive::kWheelSpeed) |
              static_cast<unsigned>(Drive::kTwist),
    .summary = "Turning follows its command sooner or later than driving does.",
    .equation = "tau' = tau + extra for what all wheels turn the body by together",
    .leaves_out = "another time constant of driving sideways than of driving ahead",
    .measure = "steps from rest straight on and on the spot, and arcs",
    .reference =
        "wheels carry the mass in driving and the moment of inertia in turning; Siciliano et al. "
        "2009, Robotics, sec. 11.4",
    .family = Family::kTransient,
    .needs = Needs::kChanges,
    .phrase = "turning follows its command sooner or later than driving",
    .identify = kSteps | kSpin | kStraight,
};

constexpr ParameterSpec kParameters[] = {
    {"extra_s", "s", 0, -0.02, -0.5, 0.5, "time constant of turning less that of driving",
     "turning follows later than driving", "turning follows sooner than driving", 0.05},
};

// Share of a gap that is closed: exact in steps so short that its decay rounds to 1.
double Closed(double dt_s, double tau_s)
{
    return tau_s > 0 ? -std::expm1(-dt_s / tau_s) : 1;
}

// Sets targets at which wheels with their own time constant end the step where the part of their
// speeds that turns the body ends with the other. A second one adds to the first: the targets have
// that one's part already.
void Step(WheelSignals &s, const Numbers &v, double *)
{
    if (v[0] == 0 || s.dt_s <= 0)
        return;
    const double before_s = s.turn_extra_s;
    s.turn_extra_s += v[0];
    double turn_mps = 0, wanted_mps = 0;  // along s.robot.spin
    for (int k = 0; k < s.robot.wheels; ++k)
    {
        if (s.IsCoasting(k))
            return;
        turn_mps += s.robot.spin[k] * s.rim_mps[k];
        wanted_mps += s.robot.spin[k] * s.target_mps[k];
    }
    double before = 0, after = 0;
    for (int k = 0; k < s.robot.wheels; ++k)
    {
        if (k == 0 || s.tau_s[k] != s.tau_s[k - 1])  // most often all lag alike
        {
            before = Closed(s.dt_s, s.tau_s[k] + before_s);
            after = Closed(s.dt_s, s.tau_s[k] + s.turn_extra_s);
        }
        const double gap_mps = s.robot.spin[k] * (turn_mps - wanted_mps);
        s.target_mps[k] += gap_mps * (before - after) / before;
    }
}

}  // namespace

EFFECT(yaw_lag) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnWheels{Step},
    // On the speeds and time constants that all others leave: it splits that lag in two.
    .turn = Turn::kLast,
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "motor_lag",
    .drives = kAnyDrive,
    .summary = "Wheels take longer to reach their speed than the base model says.",
    .equation = "tau' = tau + extra; tau' dv/dt = target - v",
    .leaves_out = "dependence on duty (lag_by_duty) and on the direction of change (coasting)",
    .measure = "steps from rest to several duties and back",
    .reference = "first-order motor model; Siciliano et al. 2009, Robotics, sec. 5.2",
    .family = Family::kTransient,
    .needs = Needs::kChanges,
    .phrase = "wheels take their time to follow",
    .identify = kSteps,
    .suspect_when = kStarting | kStopping | kChanging,
};

constexpr ParameterSpec kParameters[] = {
    {"extra_s", "s", 0, 0.03, -0.5, 0.5, "added to the time constant of every wheel",
     "wheels follow more slowly", "wheels follow faster", 0.3, Role::kLateness},
};

void Step(WheelSignals &s, const Numbers &v, double *)
{
    for (int k = 0; k < s.robot.wheels; ++k)
        if (!s.IsCoasting(k))
            s.tau_s[k] = std::max(0.0, s.tau_s[k] + v[0]);
}

}  // namespace

EFFECT(motor_lag) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnWheels{Step},
};

}  // namespace twin

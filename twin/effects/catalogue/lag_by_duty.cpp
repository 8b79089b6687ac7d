// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "lag_by_duty",
    .drives = kDutyOnly,
    .summary = "Wheels take longer to reach low speeds than high ones.",
    .equation = "tau' = tau + extra (1 - |u|)",
    .leaves_out = "curvature of the dependence",
    .measure = "steps from rest to five or more duties",
    .reference = "linear in duty; seen on a TurboPi: 0.04 s at full and 0.11 s at half duty",
    .family = Family::kTransient,
    .needs = Needs::kChanges,
    .phrase = "slow commands take longer to act",
    .identify = kSteps | kLevels,
    .suspect_when = kStarting | kChanging,
};

constexpr ParameterSpec kParameters[] = {
    {"extra_s", "s", 0, 0.1, -0.5, 1, "time constant at zero duty less that at full duty",
     "slow commands take longer to act", "fast commands take longer to act", 0.3},
};

void Step(WheelSignals &s, const Numbers &v, double *)
{
    for (int k = 0; k < s.robot.wheels; ++k)
        if (!s.IsCoasting(k))
            s.tau_s[k] = std::max(0.0, s.tau_s[k] + v[0] * std::max(0.0, 1 - std::abs(s.duty[k])));
}

}  // namespace

EFFECT(lag_by_duty) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnWheels{Step},
};

}  // namespace twin

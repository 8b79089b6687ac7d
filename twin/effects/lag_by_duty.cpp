// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "lag_by_duty",
    .stage = Stage::kWheel,
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

constexpr Parameter kParameters[] = {
    {"extra_s", "s", 0, 0.1, -0.5, 1, "time constant at zero duty less that at full duty",
     "slow commands take longer to act", "fast commands take longer to act", 0.3},
};

class LagByDuty final : public Effect
{
public:
    explicit LagByDuty(std::span<const double> v) : extra_s_(v[0]) {}

    void Step(Signals &s, double *) const override
    {
        for (int k = 0; k < kWheels; ++k)
            if (!Rolls(s, k))
                s.tau_s[k] =
                    std::max(0.0, s.tau_s[k] + extra_s_ * std::max(0.0, 1 - std::abs(s.duty[k])));
    }

private:
    double extra_s_;
};

}  // namespace

extern const EffectSpec kLagByDuty;
const EffectSpec kLagByDuty = {kCard, kParameters, Make<LagByDuty>};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "dead_zone",
    .drives = kDutyOnly,
    .summary = "Small duties do not turn the wheels: friction holds them.",
    .equation = "u' = sign(u) max(0, |u| - width)",
    .leaves_out = "stick: a moving wheel stops at the same duty at which it starts",
    .measure = "steps to several duties below 40 %, each from rest",
    .reference =
        "Tao and Kokotovic 1996, Adaptive Control of Systems with Actuator and Sensor Nonlinearities, ch. 2",
    .family = Family::kFriction,
    .needs = Needs::kSteadySpeed,
    .phrase = "small commands do not move the wheels",
    .identify = kSteps | kLevels,
    .suspect_when = kStanding,
};

constexpr ParameterSpec kParameters[] = {
    {"width", "1", 0, 0.05, 0, 0.6,
     "duty below which a wheel stands still, as a fraction of full duty",
     "does not move at small duties", "moves at smaller duties"},
};

void Step(DutySignals &s, const Numbers &v, double *)
{
    for (double &u : s.duty)
        u = std::copysign(std::max(0.0, std::abs(u) - v[0]), u);
}

}  // namespace

EFFECT(dead_zone) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnDuty{Step},
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "stiction",
    .drives = kDutyOnly,
    .summary = "Small duties do not turn the wheels, and all larger ones turn them as usual.",
    .equation = "u' = u / (1 + (below / |u|)^24)",
    .leaves_out =
        "a sharp edge; a moving wheel that goes on turning at a duty at which it would not start",
    .measure = "steps to several duties below 40 %, each from rest, and above",
    .reference =
        "static friction with breakaway; Armstrong-Hélouvry et al. 1994, Automatica 30(7), sec. 2",
    .family = Family::kFriction,
    .needs = Needs::kSteadySpeed,
    .phrase = "stands at small commands, and is as usual at larger ones",
    .identify = kSteps | kLevels,
    .suspect_when = kStanding,
};

constexpr ParameterSpec kParameters[] = {
    {"below", "1", 0, 0.1, 0, 0.7,
     "duty below which a wheel stands, as a fraction of full duty; at it, half its speed is left",
     "does not move at small duties", "moves at smaller duties", 0.3, Role::kLimit},
};

// x^24: 1 % of the speed is there at 0.83 of the edge, 99 % at 1.21 times it. Five products are
// quicker than std::pow.
double Steep(double x)
{
    const double x2 = x * x, x4 = x2 * x2, x8 = x4 * x4;
    return x8 * x8 * x8;
}

void Step(DutySignals &s, const Numbers &v, double *)
{
    if (v[0] == 0)
        return;
    for (double &u : s.duty)
        if (u != 0)
            u /= 1 + Steep(v[0] / std::abs(u));
}

}  // namespace

EFFECT(stiction) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnDuty{Step},
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "speed_curve",
    .drives = kDutyOnly,
    .summary = "Speed is not proportional to duty: it saturates or is steeper at the top.",
    .equation = "u' = u + u (1 - |u|) (bend + skew (1 - 2 |u|))",
    .leaves_out = "differences between wheels and directions of rotation",
    .measure = "steady straight drives at five or more duties",
    .reference =
        "cubic through 0 and full duty; compare the duty table of Hiwonder TurboPi measurements",
    .family = Family::kGain,
    .needs = Needs::kSteadySpeed,
    .phrase = "speed is not proportional to the command",
    .identify = kStraight | kLevels,
    .suspect_when = kSteady,
};

constexpr ParameterSpec kParameters[] = {
    {"bend", "1", 0, 0.5, -0.9, 2,
     "rise over the straight line: half duty gives bend/4 of full speed more",
     "too fast at middle duties", "too slow at middle duties"},
    {"skew", "1", 0, 0.1, -2, 2, "moves the rise towards low duties", "the rise is at low duties",
     "the rise is at high duties"},
};

void Step(DutySignals &s, const Numbers &v, double *)
{
    for (double &u : s.duty)
    {
        const double a = std::abs(u);
        u += u * (1 - a) * (v[0] + v[1] * (1 - 2 * a));
    }
}

}  // namespace

EFFECT(speed_curve) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnDuty{Step},
};

}  // namespace twin

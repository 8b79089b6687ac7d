// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "speed_limit",
    .drives = static_cast<unsigned>(Drive::kTwist),
    .summary = "The robot's controller cuts commands to a top speed.",
    .equation = "v' = v min(1, 1 / (pace |v|)), v = (vx, vy)",
    .leaves_out = "limits of single wheels and of the turn rate",
    .measure = "straight drives at five or more speeds, some above the top speed",
    .reference =
        "saturation of the command; Franklin et al. 2010, Feedback Control of Dynamic Systems, "
        "sec. 9.3",
    .family = Family::kGain,
    .needs = Needs::kSteadySpeed,
    .phrase = "does not go faster than a top speed",
    .identify = kStraight | kLevels,
};

constexpr ParameterSpec kParameters[] = {
    {"pace_s_per_m", "s/m", 0, 2, 0, 20, "time for a metre at top speed, 1 / limit; 0: no limit",
     "does not reach fast commands", "reaches them", 2, Role::kLimit},
};

void Step(DutySignals &s, const Numbers &v, double *)
{
    const double over = v[0] * std::hypot(s.duty[0], s.duty[1]);
    if (over <= 1)
        return;
    s.duty[0] /= over;
    s.duty[1] /= over;
}

}  // namespace

EFFECT(speed_limit) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnDuty{Step},
};

}  // namespace twin

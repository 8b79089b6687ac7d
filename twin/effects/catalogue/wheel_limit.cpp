// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "wheel_limit",
    .drives = static_cast<unsigned>(Drive::kWheelSpeed) | static_cast<unsigned>(Drive::kTwist),
    .summary = "No wheel turns faster than a top speed, whatever the others do.",
    .equation = "|v'| <= 1 / pace, v the speed of a wheel's rim",
    .leaves_out =
        "controllers that slow all wheels together, so that the way is kept; see speed_limit",
    .measure =
        "curves at high speed, where the outer wheels reach the limit and the inner ones do not",
    .reference =
        "saturation of the actuators; Franklin et al. 2010, Feedback Control of Dynamic Systems, "
        "sec. 9.3",
    .family = Family::kGain,
    .needs = Needs::kSteadySpeed,
    .phrase = "wheels do not go faster than a top speed",
    .identify = kStraight | kArcs | kLevels,
};

constexpr ParameterSpec kParameters[] = {
    {"pace_s_per_m", "s/m", 0, 2, 0, 20, "time for a metre at top speed, 1 / limit; 0: no limit",
     "wheels do not reach fast commands", "wheels reach them", 2, Role::kLimit},
};

void Step(WheelSignals &s, const Numbers &v, double *)
{
    if (v[0] <= 0)
        return;
    for (int k = 0; k < s.robot.wheels; ++k)
        s.target_mps[k] = std::clamp(s.target_mps[k], -1 / v[0], 1 / v[0]);
}

}  // namespace

EFFECT(wheel_limit) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnWheels{Step},
    .needs_wheels = true,
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "coasting",
    .drives = kDutyOnly,
    .summary = "At zero duty the motors do not brake: the robot rolls to a stop.",
    .equation = "u = 0: |dv/dt| <= deceleration + viscous |v|, tau' = 0",
    .leaves_out = "rolling on at duties that are small but not zero",
    .measure = "stops to zero duty from several speeds",
    .reference =
        "Coulomb friction of an open motor; Olsson et al. 1998, Friction models and friction compensation",
    .family = Family::kTransient,
    .needs = Needs::kChanges,
    .phrase = "rolls on when it is told to stop",
    .identify = kStops,
    .suspect_when = kStopping,
};

constexpr ParameterSpec kParameters[] = {
    {"deceleration_mps2", "m/s^2", 20, 0.7, 0.05, 20,
     "deceleration of a wheel's rim while its duty is zero; 20: as without coasting",
     "stops at once", "rolls on after a stop", 0, Role::kLimit},
    {"viscous_per_s", "1/s", 0, 0.5, 0, 20, "what speed adds to the deceleration",
     "rolls on less from high speeds", "rolls on more from high speeds"},
};

void Step(WheelSignals &s, const Numbers &v, double *)
{
    const double deceleration_mps2 = v[0], viscous_per_s = v[1];
    if (deceleration_mps2 >= kParameters[0].neutral)
        return;
    for (int k = 0; k < s.robot.wheels; ++k)
    {
        if (s.duty[k] != 0)
            continue;
        s.tau_s[k] = 0;
        // Drag at the speed in the middle of the step: right to second order.
        const double half_s = std::min(s.dt_s / 2, 1 / (1 + viscous_per_s));
        const double start_mps2 = deceleration_mps2 + viscous_per_s * std::abs(s.rim_mps[k]);
        s.max_decel_mps2[k] = start_mps2 * (1 - viscous_per_s * half_s);
    }
}

}  // namespace

EFFECT(coasting) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnWheels{Step},
};

}  // namespace twin

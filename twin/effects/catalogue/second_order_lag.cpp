// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "second_order_lag",
    .drives = kAnyDrive,
    .summary = "Wheels follow with two time constants, one after the other.",
    .equation = "second dw/dt = target - w; tau dv/dt = w - v",
    .leaves_out = "overshoot of a controller",
    .measure =
        "steps from rest to several duties and back, on one clock with the poses, seen 50 times a "
        "second or more; else input_delay looks alike",
    .reference =
        "electrical and mechanical pole of a motor, or a filter before it; Franklin et al. 2010, "
        "Feedback Control of Dynamic Systems, sec. 2.3",
    .family = Family::kTransient,
    .needs = Needs::kChanges,
    .phrase = "wheels follow slowly at first, as behind a filter",
    .identify = kSteps,
};

constexpr ParameterSpec kParameters[] = {
    {"second_s", "s", 0, 0.03, 0, 0.5, "time constant of the second lag",
     "speeds change slowly at first", "speeds change at once", 0.3, Role::kLateness},
};

// What the first lag puts out, of each wheel.
int StateSize(const Numbers &v)
{
    return v[0] > 0 ? kMaxWheels : 0;
}

// The wheel tends to the mean of what the first lag puts out over the step.
void Step(WheelSignals &s, const Numbers &v, double *out_mps)
{
    if (v[0] <= 0)
        return;
    const double decay = std::exp(-s.dt_s / v[0]);
    for (int k = 0; k < s.robot.wheels; ++k)
    {
        if (s.IsCoasting(k))
        {
            out_mps[k] = s.rim_mps[k];
            continue;
        }
        const double target_mps = s.target_mps[k], gap_mps = out_mps[k] - target_mps;
        s.target_mps[k] += gap_mps * (1 - decay) * v[0] / s.dt_s;
        out_mps[k] = target_mps + gap_mps * decay;
    }
}

}  // namespace

EFFECT(second_order_lag) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnWheels{Step},
    .state_size = StateSize,
};

}  // namespace twin

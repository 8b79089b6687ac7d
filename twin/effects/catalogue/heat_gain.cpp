// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "heat_gain",
    .drives = kDutyOnly,
    .summary = "Wheels slow down as their motors get warm.",
    .equation =
        "v' = v (1 - loss h); 60 s dh/dt = u^2 - h, each wheel by itself, cold at the start",
    .leaves_out =
        "the room's temperature, cooling by the wind of driving, motors that warm up in another "
        "time than 60 s; a log that starts warm",
    .measure =
        "one continuous drive of two minutes at full duty after a rest; battery_sag looks "
        "alike where the battery empties meanwhile",
    .reference = "first-order thermal model; Hughes and Drury 2019, Electric Motors and Drives",
    .family = Family::kPower,
    .needs = Needs::kHistory,
    .phrase = "wheels slow down as the motors warm up",
    .identify = kStraight | kLong,
};

constexpr ParameterSpec kParameters[] = {
    {"loss", "1", 0, 0.06, -0.5, 0.5,
     "relative loss of speed of a wheel that has long been at full duty",
     "slower as the motors warm up", "faster as the motors warm up"},
};

constexpr double kMemory_s = 60;

int StateSize(const Numbers &v)
{
    return v[0] != 0 ? kMaxWheels : 0;
}

// `heat` approaches u^2; what counts is its mean over the step.
void Step(WheelSignals &s, const Numbers &v, double *heat)
{
    if (v[0] == 0)
        return;
    const double decay = std::exp(-s.dt_s / kMemory_s);
    const double mean_part = (1 - decay) * kMemory_s / s.dt_s;
    for (int k = 0; k < s.robot.wheels; ++k)
    {
        const double end = s.duty[k] * s.duty[k], gap = heat[k] - end;
        s.target_mps[k] *= 1 - v[0] * (end + gap * mean_part);
        heat[k] = end + gap * decay;
    }
}

}  // namespace

EFFECT(heat_gain) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnWheels{Step},
    .state_size = StateSize,
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "effects/ramp.h"

#include <algorithm>
#include <cmath>

namespace twin
{
namespace
{

// Over a step of a ramp that begins at `out`.
double Mean(double out, double told, double pace_s, double dt_s)
{
    const double ramp_s = std::abs(told - out) * pace_s;
    if (ramp_s <= dt_s)
        return told - (told - out) * ramp_s / (2 * dt_s);
    return out + std::copysign(dt_s / (2 * pace_s), told - out);
}

}  // namespace

// What came out at time state[0], and what was told then. A later effect may cut the step: how far
// the ramp got is known only when the next one begins.
void Ramp(DutySignals &s, const Wheels &pace_s, double *state)
{
    const double since_s = std::max(0.0, s.t_s - state[0]);
    state[0] = s.t_s;
    double *out = state + 1, *told = out + kMaxWheels;
    for (int k = 0; k < kMaxWheels; ++k)
    {
        if (pace_s[k] <= 0)
            continue;
        const double change = since_s / pace_s[k];
        out[k] += std::clamp(told[k] - out[k], -change, change);
        told[k] = s.duty[k];
        s.duty[k] = Mean(out[k], told[k], pace_s[k], s.dt_s);
    }
}

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
// How an effect takes a state through a step of the plant.
#ifndef EFFECTS_REMEMBER_H
#define EFFECTS_REMEMBER_H

#include <cmath>

namespace twin
{

// Takes `state` through a step by its rate of change, rate(state), and returns its mean over the
// step. Exact where the rate is linear in the state and all else is held (the exponential Euler
// method with the rate's own slope; Hochbruck and Ostermann 2010), however stiff. Where the rate
// has no finite value, the state stays.
template <class Rate>
double Remember(double &state, double dt_s, Rate rate)
{
    constexpr double kApart = 1e-3, kSmall = 1e-5;
    const double before = state, now = rate(before);
    const double slope = (rate(before + kApart) - now) / kApart;
    if (!std::isfinite(now) || !std::isfinite(slope))
        return before;
    const double z = slope * dt_s;
    const bool small = std::abs(z) < kSmall;
    const double grown = small ? 1 + z / 2 : std::expm1(z) / z;
    state = before + now * dt_s * grown;
    return before + now * dt_s * (small ? 0.5 + z / 6 : (grown - 1) / z);
}

}  // namespace twin

#endif

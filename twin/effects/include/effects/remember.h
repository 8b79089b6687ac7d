// SPDX-License-Identifier: Apache-2.0
// How an effect takes a state through a step of the plant.
#ifndef EFFECTS_REMEMBER_H
#define EFFECTS_REMEMBER_H

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>

namespace twin
{

// A state that grows without bound stays here: where what follows from it is asked, that is told.
constexpr double kBeyond = 1e12;

inline double Bounded(double state, double rate)
{
    return std::isnan(state) ? std::copysign(kBeyond, rate) : std::clamp(state, -kBeyond, kBeyond);
}

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
    state = Bounded(before + now * dt_s * grown, now);
    return Bounded(before + now * dt_s * (small ? 0.5 + z / 6 : (grown - 1) / z), now);
}

using TwoStates = std::array<double, 2>;

// (exp(z) - 1 - z) / z^2, by its series where that would cancel.
inline std::complex<double> SecondPhi(std::complex<double> z)
{
    constexpr double kSmall = 1e-2;
    if (std::abs(z) > kSmall)
        return (std::exp(z) - 1.0 - z) / (z * z);
    return 1.0 / 2 + z * (1.0 / 6 + z * (1.0 / 24 + z * (1.0 / 120 + z / 720.0)));
}

// The same for two states that change each other, rates(states): phi functions of the 2x2 matrix of
// slopes by its two eigenvalues, which may be complex, as those of what swings are.
template <class Rates>
TwoStates Remember(TwoStates &states, double dt_s, Rates rates)
{
    constexpr double kApart = 1e-3, kDistinct = 1e-4;
    const TwoStates before = states, now = rates(before);
    const TwoStates first = rates({before[0] + kApart, before[1]});
    const TwoStates second = rates({before[0], before[1] + kApart});
    const double by = dt_s / kApart;
    const double a = (first[0] - now[0]) * by, b = (second[0] - now[0]) * by;
    const double c = (first[1] - now[1]) * by, d = (second[1] - now[1]) * by;
    if (!std::isfinite(a + b + c + d + now[0] + now[1]))
        return before;
    const double middle = (a + d) / 2;
    std::complex<double> apart = std::sqrt(std::complex<double>((a - d) * (a - d) / 4 + b * c));
    if (std::abs(apart) < kDistinct)
        apart = kDistinct;
    const std::complex<double> high = middle + apart, low = middle - apart;
    // A function f of the matrix is mean + slope (matrix - middle), of f at the eigenvalues.
    const auto moved = [&](std::complex<double> f_high, std::complex<double> f_low) {
        const double mean = ((f_high + f_low) / 2.0).real();
        const double slope = ((f_high - f_low) / (2.0 * apart)).real();
        return TwoStates{
            Bounded(
                before[0] + dt_s * (mean * now[0] + slope * ((a - middle) * now[0] + b * now[1])),
                now[0]),
            Bounded(
                before[1] + dt_s * (mean * now[1] + slope * (c * now[0] + (d - middle) * now[1])),
                now[1])};
    };
    const std::complex<double> at_high = SecondPhi(high), at_low = SecondPhi(low);
    states = moved(1.0 + high * at_high, 1.0 + low * at_low);
    return moved(at_high, at_low);
}

}  // namespace twin

#endif

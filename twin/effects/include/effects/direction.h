// SPDX-License-Identifier: Apache-2.0
// Angles as the vectors along them: a heading that turns by little in each step needs no cosine
// then.
#ifndef EFFECTS_DIRECTION_H
#define EFFECTS_DIRECTION_H

#include <cmath>

namespace twin
{

// Below this square of an angle the series are exact: their next terms are under 1e-15. Their
// shares are multiplied: a division takes the time of many products.
constexpr double kSmallSquare = 0.0025;

inline double SmallSinOver(double square)
{
    return 1 - square * (1.0 / 6) * (1 - square * (1.0 / 20) * (1 - square * (1.0 / 42)));
}

inline double SmallCos(double square)
{
    return 1 - square * (1.0 / 2) * (1 - square * (1.0 / 12) * (1 - square * (1.0 / 30)));
}

// sin(a) / a
inline double SinOver(double a)
{
    return a * a < kSmallSquare ? SmallSinOver(a * a) : std::sin(a) / a;
}

inline double Cos(double a)
{
    return a * a < kSmallSquare ? SmallCos(a * a) : std::cos(a);
}

// A vector of length 1: cosine and sine of its angle.
struct Direction
{
    double c = 1, s = 0;

    static Direction Of(double rad) { return {Cos(rad), rad * SinOver(rad)}; }

    // Of the angle the other way.
    Direction Back() const { return {c, -s}; }

    Direction Turned(const Direction &by) const
    {
        return {c * by.c - s * by.s, s * by.c + c * by.s};
    }
};

}  // namespace twin

#endif

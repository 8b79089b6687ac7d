// SPDX-License-Identifier: Apache-2.0
#include "paper_kernel.h"

#include <cstring>

typedef float Real __attribute__((vector_size(4 * kPaperLanes)));
typedef int Mask __attribute__((vector_size(4 * kPaperLanes)));

namespace
{
constexpr float kDt_s = 0.022f, kStep_m = 0.25f * kDt_s, kTurn_rad = 0.785398f * kDt_s;
constexpr float kRange2 = 1.1f * 1.1f, kCos2 = 0.828029f;  // cos(24.5 degrees) squared
}  // namespace

void RunPaperKernel(PaperRobots &robots, int steps)
{
    constexpr int n = kPaperRobots;
    Real x[n], y[n], c[n], s[n];
    std::memcpy(x, robots.x, sizeof x);
    std::memcpy(y, robots.y, sizeof y);
    std::memcpy(c, robots.c, sizeof c);
    std::memcpy(s, robots.s, sizeof s);
    const float turn_c = 1 - kTurn_rad * kTurn_rad / 2, turn_s = kTurn_rad;
    for (int step = 0; step < steps; ++step)
    {
        Mask seen[n] = {};
        for (int i = 0; i < n; ++i)
            for (int j = i + 1; j < n; ++j)
            {
                const Real dx = x[j] - x[i], dy = y[j] - y[i], d2 = dx * dx + dy * dy;
                const Real a = c[i] * dx + s[i] * dy, b = c[j] * dx + s[j] * dy;
                const Mask near = d2 < kRange2;
                seen[i] |= near & (a > 0) & (a * a > kCos2 * d2);
                seen[j] |= near & (b < 0) & (b * b > kCos2 * d2);
            }
        for (int i = 0; i < n; ++i)
        {
            x[i] += kStep_m * c[i];
            y[i] += kStep_m * s[i];
            const Real turn = seen[i] ? turn_s - Real{} : -turn_s - Real{};
            const Real was = c[i];
            c[i] = c[i] * turn_c - s[i] * turn;
            s[i] = s[i] * turn_c + was * turn;
        }
    }
    std::memcpy(robots.x, x, sizeof x);
    std::memcpy(robots.y, y, sizeof y);
    std::memcpy(robots.c, c, sizeof c);
    std::memcpy(robots.s, s, sizeof s);
}

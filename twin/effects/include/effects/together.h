// SPDX-License-Identifier: Apache-2.0
// A few robots that are moved together, quantity by quantity: loops over them have no branches, so
// that the processor works on as many at once as its vectors hold.
#ifndef EFFECTS_TOGETHER_H
#define EFFECTS_TOGETHER_H

#include <array>
#include <cstddef>

#include "effects/signals.h"

namespace twin
{

constexpr size_t kTogether = 8;
// A number of each robot.
using Each = std::array<double, kTogether>;

// Cosines of the first `count` angles, and their sines over the angles.
struct Turns
{
    Each cos{}, sin_over{};

    Turns(const Each &rad, size_t count)
    {
        bool small = true;
        for (size_t i = 0; i < count; ++i)
            small &= rad[i] * rad[i] < kSmallSquare;
        if (small)
            for (size_t i = 0; i < count; ++i)
            {
                cos[i] = SmallCos(rad[i] * rad[i]);
                sin_over[i] = SmallSinOver(rad[i] * rad[i]);
            }
        else
            for (size_t i = 0; i < count; ++i)
            {
                cos[i] = Cos(rad[i]);
                sin_over[i] = SinOver(rad[i]);
            }
    }
};

// Poses, and the cosines and sines of their headings.
struct EachPose
{
    Each x_m{}, y_m{}, theta_rad{}, c{}, s{};
};

// The GroundSignals of the first `count` robots, whose wheels move alike.
struct EachGround
{
    const RobotFacts &robot;
    const double t_s, dt_s;
    const bool moves;
    const EachPose &pose;
    const size_t count;
    Each vx_mps{}, vy_mps{}, omega_radps{};

    GroundSignals At(size_t i) const
    {
        return {robot,
                t_s,
                dt_s,
                moves,
                pose.x_m[i],
                pose.y_m[i],
                pose.theta_rad[i],
                {pose.c[i], pose.s[i]},
                vx_mps[i],
                vy_mps[i],
                omega_radps[i]};
    }

    void Take(size_t i, const GroundSignals &signals)
    {
        vx_mps[i] = signals.vx_mps;
        vy_mps[i] = signals.vy_mps;
        omega_radps[i] = signals.omega_radps;
    }
};

}  // namespace twin

#endif

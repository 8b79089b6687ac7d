// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(FloorPatch, SlowsWellInsideAndNotFarOutside)
{
    for (const double strength : {0.3, -0.3})
    {
        Player inside(With("floor_patch", {strength, 5, 1, 2}), 0.02, {4.8, 1, 0});
        Player outside(With("floor_patch", {strength, 5, 1, 2}), 0.02);
        for (Player *player : {&inside, &outside})
        {
            player->Play(kForward, 1);
            player->Play(kTurnLeft, 1);
        }
        // 1.5 m inside and 2.6 m outside the edge's 0.1 m: tanh(15) is 1 but for 2e-13.
        EXPECT_NEAR(inside.state.pose.x_m - 4.8, (1 - strength) * kFull_mps, 1e-9);
        EXPECT_NEAR(inside.state.pose.theta_rad, (1 - strength) * kFull_mps / kLever_m, 1e-9);
        EXPECT_NEAR(outside.state.pose.x_m, kFull_mps, 1e-9);
    }
}

// Half the loss on the edge, wherever on it.
TEST(FloorPatch, HasItsEdgeAtTheRadius)
{
    const auto effect = MakeAlone("floor_patch", {0.4, 1, -1, 0.5});
    for (double at_rad = 0; at_rad < 6; at_rad += 0.7)
    {
        Signals s;
        s.x_m = 1 + 0.5 * std::cos(at_rad);
        s.y_m = -1 + 0.5 * std::sin(at_rad);
        s.vx_mps = 1;
        effect.Step(s, nullptr);
        EXPECT_NEAR(s.vx_mps, 0.8, 1e-12);
    }
}

// dx/dt = v (1 - strength w(x)) through the middle of the patch: the time to cross is the integral
// of 1 / (v (1 - strength w)), here by Simpson's rule. The step is right to second order.
TEST(FloorPatch, TakesTheTimeOfItsIntegralToCross)
{
    const double strength = 0.5, radius_m = 0.4, from_m = -2, to_m = 1;
    double time_s = 0;
    for (int i = 0; i <= 3000; ++i)
    {
        const double x_m = from_m + 0.001 * i;
        const double w = (1 - std::tanh((std::abs(x_m) - radius_m) / 0.1)) / 2;
        const double weight = i == 0 || i == 3000 ? 1 : (i % 2 ? 4 : 2);
        time_s += weight / 3 * 0.001 / (kFull_mps * (1 - strength * w));
    }
    double missed_m[2];
    for (int i = 0; i < 2; ++i)
    {
        const double dt_s = time_s / (i ? 400 : 200);
        Player player(With("floor_patch", {strength, 0, 0, radius_m}), dt_s, {from_m, 0, 0});
        player.Play(kForward, time_s);
        missed_m[i] = std::abs(player.state.pose.x_m - to_m);
    }
    EXPECT_LT(missed_m[0], 1e-3);
    EXPECT_LT(missed_m[1], missed_m[0] / 3 + 1e-7);
}

}  // namespace
}  // namespace twin::test

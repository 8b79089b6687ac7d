// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

// h(t) = u^2 (1 - exp(-t / 60 s)); the way is the integral of v (1 - loss h).
TEST(HeatGain, TakesSpeedWithAMemoryOfAMinute)
{
    for (const double duty : {1.0, -0.5})
        for (const double t_s : {6.0, 60.0, 300.0})
        {
            Player player(With("heat_gain", {0.2}), 0.02);
            player.Play(Scaled(kForward, duty), t_s);
            const double heat_s = t_s - 60 * (1 - std::exp(-t_s / 60));
            EXPECT_NEAR(player.state.pose.x_m,
                        duty * kFull_mps * (t_s - 0.2 * duty * duty * heat_s), 1e-9);
        }
}

// 60 s ln 2 of rest halve the loss.
TEST(HeatGain, CoolsAtRest)
{
    Player player(With("heat_gain", {0.2}), 0.02);
    player.Play(kForward, 600);
    EXPECT_NEAR(player.state.vx_mps, 0.8 * kFull_mps, 1e-5);  // exp(-10) is missing
    player.Play(kStop, 41.58);
    player.Play(kForward, 0.02);
    EXPECT_NEAR(player.state.vx_mps, 0.9 * kFull_mps, 1e-4);
}

TEST(HeatGain, WarmsEachWheelByItself)
{
    Player player(With("heat_gain", {0.2}), 0.02);
    player.Play({1, 0, 1, 0}, 600);
    player.Play(kForward, 0.02);
    EXPECT_NEAR(player.state.rim_mps[0], 0.8 * kFull_mps, 1e-4);
    EXPECT_NEAR(player.state.rim_mps[1], kFull_mps, 1e-4);
}

}  // namespace
}  // namespace twin::test

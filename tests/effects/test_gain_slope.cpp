// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <numbers>

#include "drive.h"

namespace twin::test
{
namespace
{

// dx/dt = v (1 + g x): x(t) = ((1 + g x0) exp(g v t) - 1) / g.
TEST(GainSlope, GrowsExponentiallyAlongItself)
{
    for (const double dt_s : {0.02, 0.5})
        for (const double g : {0.2, -0.2})
            for (const bool along_y : {false, true})
            {
                const Pose2 start{along_y ? 0 : 1.5, along_y ? 1.5 : 0,
                                  along_y ? std::numbers::pi / 2 : 0};
                Player player(With("gain_slope", {along_y ? 0 : g, along_y ? g : 0}), dt_s, start);
                player.Play(kForward, 4);
                const double end_m = ((1 + g * 1.5) * std::exp(g * kFull_mps * 4) - 1) / g;
                EXPECT_NEAR(along_y ? player.state.pose.y_m : player.state.pose.x_m, end_m, 1e-12);
            }
}

TEST(GainSlope, IsTheSameEverywhereAcrossItself)
{
    Player player(With("gain_slope", {0.1, 0}), 0.02, {2, 0, std::numbers::pi / 2});
    player.Play(kForward, 1);
    EXPECT_NEAR(player.state.pose.y_m, 1.2 * kFull_mps, 1e-12);
}

TEST(GainSlope, LeavesTurnsAlone)
{
    Player player(With("gain_slope", {0.3, 0.3}), 0.02, {2, 2, 0});
    player.Play(kTurnLeft, 1);
    EXPECT_NEAR(player.state.pose.theta_rad, kFull_mps / kLever_m, 1e-12);
}

}  // namespace
}  // namespace twin::test

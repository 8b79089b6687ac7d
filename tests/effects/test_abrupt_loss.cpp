// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "drive.h"

namespace twin::test
{
namespace
{

// The way is v t before the moment, v (1 - loss) t after it; the edge is symmetric and takes
// nothing from the sum.
TEST(AbruptLoss, LosesFromItsMomentOn)
{
    for (const double loss : {0.3, -0.3})
        for (const double from_s : {3.0, 7.5})
        {
            Player player(With("abrupt_loss", {loss, 0, from_s}), 0.02);
            player.Play(kForward, 10);
            EXPECT_NEAR(player.state.pose.x_m, kFull_mps * (10 - loss * (10 - from_s)), 1e-6);
        }
}

// The integral of 1 / (1 + exp(-t / e)) is e ln(1 + exp(t / e)).
TEST(AbruptLoss, ComesOverSeconds)
{
    for (const double edge_s : {0.5, 2.0})
    {
        Player player(With("abrupt_loss", {0.3, 0, 4, edge_s}), 0.02);
        player.Play(kForward, 10);
        const auto until = [edge_s](double t_s) { return std::log1p(std::exp(t_s / edge_s)); };
        const double lost_s = 0.3 * edge_s * (until(10 - 4) - until(0 - 4));
        EXPECT_NEAR(player.state.pose.x_m, kFull_mps * (10 - lost_s), 1e-5);
    }
}

TEST(AbruptLoss, SlowsTurnsAndSidewaysAlike)
{
    Player player(With("abrupt_loss", {0.4, 0, 1}), 0.02);
    player.Play(kTurnLeft, 2);
    const double turned_rad = player.state.pose.theta_rad;
    player.Play(kTurnLeft, 1);
    EXPECT_NEAR(player.state.pose.theta_rad - turned_rad, 0.6 * kFull_mps / kLever_m, 1e-4);
}

// A difference of the sides alone turns the robot by it over the lever, and leaves its speed.
TEST(AbruptLoss, TurnsToTheWeakerSide)
{
    Player player(With("abrupt_loss", {0, 0.1, 2}), 0.02);
    player.Play(kForward, 4);
    player.Play(kForward, 1);
    EXPECT_NEAR(player.state.pose.theta_rad, 3 * 0.1 * kFull_mps / kLever_m, 1e-6);
}

}  // namespace
}  // namespace twin::test

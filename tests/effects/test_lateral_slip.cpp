// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

// On an arc of speed v and rate w the robot slips outwards with slip w v, right of it on a left
// turn: its speed is v sqrt(1 + (slip w)^2).
TEST(LateralSlip, PushesOutOfTheCurve)
{
    for (const double side : {1.0, -1.0})
    {
        const Wheels arc = side > 0 ? Wheels{0.4, 0.8, 0.4, 0.8} : Wheels{0.8, 0.4, 0.8, 0.4};
        Player player(With("lateral_slip", {0.05}), 0.02);
        player.Play(arc, 0.02);
        const double omega_radps = side * 0.2 * kFull_mps / kLever_m;
        EXPECT_NEAR(player.state.omega_radps, omega_radps, 1e-12);
        EXPECT_NEAR(player.state.vx_mps, 0.6 * kFull_mps, 1e-12);
        EXPECT_NEAR(player.state.vy_mps, -0.05 * omega_radps * 0.6 * kFull_mps, 1e-12);
    }
}

// Strafing left while turning left, outwards is forward.
TEST(LateralSlip, PushesOutOfTheCurveOfASidewaysDriveToo)
{
    Player player(With("lateral_slip", {0.05}), 0.02);
    player.Play({-0.8, 0.8, 0.2, -0.2}, 0.02);
    ASSERT_GT(player.state.vy_mps, 0.1);
    ASSERT_GT(player.state.omega_radps, 0.1);
    EXPECT_NEAR(player.state.vx_mps, 0.05 * player.state.omega_radps * player.state.vy_mps, 1e-12);
}

TEST(LateralSlip, LeavesStraightDrivesAndTurnsOnTheSpotAlone)
{
    Player player(With("lateral_slip", {0.1}), 0.02);
    player.Play(kForward, 1);
    player.Play(kTurnLeft, 1);
    EXPECT_NEAR(player.state.pose.x_m, kFull_mps, 1e-12);
    EXPECT_NEAR(player.state.pose.y_m, 0, 1e-12);
}

}  // namespace
}  // namespace twin::test

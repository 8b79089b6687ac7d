// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(TurnAsymmetry, TurnsFasterLeftThanRight)
{
    for (const double duty : {0.3, 1.0})
    {
        Player left(With("turn_asymmetry", {0.1}), 0.02),
            right(With("turn_asymmetry", {0.1}), 0.02);
        left.Play(Scaled(kTurnLeft, duty), 1);
        right.Play(Scaled(kTurnLeft, -duty), 1);
        const double turn_rad = duty * kFull_mps / kLever_m;
        EXPECT_NEAR(left.state.pose.theta_rad, 1.1 * turn_rad, 1e-12);
        EXPECT_NEAR(right.state.pose.theta_rad, -0.9 * turn_rad, 1e-12);
    }
}

TEST(TurnAsymmetry, LeavesStraightDrivesAlone)
{
    Player player(With("turn_asymmetry", {0.5}), 0.02);
    player.Play(kForward, 1);
    EXPECT_EQ(player.state.pose.theta_rad, 0);
    EXPECT_NEAR(player.state.pose.x_m, kFull_mps, 1e-12);
}

}  // namespace
}  // namespace twin::test

// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(YawLever, LeavesTurnsOnTheSpotAndStraightDrivesAlone)
{
    Player player(With("yaw_lever", {0.5}), 0.02);
    player.Play(kTurnLeft, 1);
    EXPECT_NEAR(player.state.pose.theta_rad, kFull_mps / kLever_m, 1e-12);
    Player straight(With("yaw_lever", {0.5}), 0.02);
    straight.Play(kForward, 1);
    EXPECT_EQ(straight.state.pose.theta_rad, 0);
}

TEST(YawLever, RaisesTheRateInProportionToSpeed)
{
    for (const double v : {0.2, 0.6, -0.6})
    {
        Player player(With("yaw_lever", {0.5}), 0.02);
        player.Play({v - 0.2, v + 0.2, v - 0.2, v + 0.2}, 1);
        const double still_radps = 0.2 * kFull_mps / kLever_m;
        EXPECT_NEAR(player.state.pose.theta_rad, still_radps * (1 + 0.5 * std::abs(v) * kFull_mps),
                    1e-12);
        EXPECT_NEAR(player.state.vx_mps, v * kFull_mps, 1e-12);
    }
}

}  // namespace
}  // namespace twin::test

// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(DeadZone, HoldsBelowAndAtItsWidthAndShiftsAbove)
{
    for (const double sign : {1.0, -1.0})
    {
        EXPECT_EQ(DutyAfter("dead_zone", {0.25}, 0), 0);
        EXPECT_EQ(DutyAfter("dead_zone", {0.25}, sign * 0.125), 0);
        EXPECT_EQ(DutyAfter("dead_zone", {0.25}, sign * 0.25), 0);
        EXPECT_EQ(DutyAfter("dead_zone", {0.25}, sign * 0.375), sign * 0.125);
        EXPECT_EQ(DutyAfter("dead_zone", {0.25}, sign * 1), sign * 0.75);
    }
}

TEST(DeadZone, TwoInARowAddTheirWidths)
{
    Player player(With("dead_zone", {0.25}, With("dead_zone", {0.125})), 0.02);
    player.Play(Scaled(kForward, 0.875), 1);
    EXPECT_NEAR(player.state.pose.x_m, 0.5 * kFull_mps, 1e-12);
}

TEST(DeadZone, ARobotBelowItStandsStill)
{
    Player player(With("dead_zone", {0.25}), 0.02);
    player.Play(Scaled(kTurnLeft, 0.2), 1);
    EXPECT_EQ(player.state.pose.theta_rad, 0);
    EXPECT_EQ(player.state.pose.x_m, 0);
}

}  // namespace
}  // namespace twin::test

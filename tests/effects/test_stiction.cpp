// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(Stiction, HoldsBelowAndLeavesWhatIsAbove)
{
    for (const double sign : {1.0, -1.0})
    {
        // By the powers 2^24 = 16777216 and 1.5^24 = 16834.112.
        EXPECT_NEAR(DutyAfter("stiction", {0.25}, sign * 0.125), sign * 0.125 / 16777217, 1e-15);
        EXPECT_NEAR(DutyAfter("stiction", {0.25}, sign * 0.375),
                    sign * 0.375 / (1 + 1 / 16834.112196028232574462890625), 1e-15);
        EXPECT_EQ(DutyAfter("stiction", {0.25}, sign * 0.25), sign * 0.125);
    }
    EXPECT_EQ(DutyAfter("stiction", {0.25}, 0), 0);
}

TEST(Stiction, NeverMakesAWheelFasterAtASmallerDuty)
{
    double last = 0;
    for (int step = 0; step <= 1000; ++step)
    {
        const double u = DutyAfter("stiction", {0.3}, step / 1000.0);
        EXPECT_GE(u, last - 1e-15);
        last = u;
    }
}

TEST(Stiction, ARobotBelowItStandsStill)
{
    Player player(With("stiction", {0.4}), 0.02);
    player.Play(Scaled(kTurnLeft, 0.1), 1);
    EXPECT_NEAR(player.state.pose.theta_rad, 0, 1e-6);
    EXPECT_EQ(player.state.pose.x_m, 0);
}

}  // namespace
}  // namespace twin::test

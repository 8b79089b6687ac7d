// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(SpeedSlip, TakesAShareThatGrowsWithSpeedInEveryDirection)
{
    for (const Wheels &way : {kForward, kBack, kStrafeLeft})
        for (const double duty : {0.25, 0.5, 1.0})
        {
            Player player(With("speed_slip", {0.5}), 0.02);
            player.Play(Scaled(way, duty), 1);
            const double v_mps = duty * kFull_mps;
            EXPECT_NEAR(std::hypot(player.state.pose.x_m, player.state.pose.y_m),
                        v_mps * (1 - 0.5 * v_mps), 1e-12);
        }
}

TEST(SpeedSlip, LeavesTurnsAlone)
{
    Player player(With("speed_slip", {0.5}), 0.02);
    player.Play(kTurnLeft, 1);
    EXPECT_NEAR(player.state.pose.theta_rad, kFull_mps / kLever_m, 1e-12);
}

// A loss of all speed is the most that friction can take.
TEST(SpeedSlip, NeverTurnsTheMotionRound)
{
    Signals s;
    s.vx_mps = -3;
    MakeAlone("speed_slip", {2}).Step(s, nullptr);
    EXPECT_EQ(s.vx_mps, 0);
}

}  // namespace
}  // namespace twin::test

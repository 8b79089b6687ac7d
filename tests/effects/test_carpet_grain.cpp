// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <numbers>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(CarpetGrain, IsFastAlongTheGrainAndSlowAcrossIt)
{
    const struct
    {
        double heading_rad, gain;
    } cases[] = {{0, 1.1},
                 {std::numbers::pi / 2, 0.9},
                 {std::numbers::pi, 1.1},
                 {std::numbers::pi / 4, 1.03},
                 {-std::numbers::pi / 4, 0.97}};
    for (const auto &c : cases)
    {
        Player player(With("carpet_grain", {0.1, 0.03}), 0.02, {0, 0, c.heading_rad});
        player.Play(kForward, 1);
        EXPECT_NEAR(player.state.pose.x_m, c.gain * kFull_mps * std::cos(c.heading_rad), 1e-12);
        EXPECT_NEAR(player.state.pose.y_m, c.gain * kFull_mps * std::sin(c.heading_rad), 1e-12);
    }
}

// What counts is where the robot goes, not where it looks.
TEST(CarpetGrain, FollowsTheDirectionOfTravel)
{
    Player player(With("carpet_grain", {0.1, 0}), 0.02);
    player.Play(kStrafeLeft, 1);
    EXPECT_NEAR(player.state.pose.y_m, 0.9 * kFull_mps, 1e-12);
    Player turned(With("carpet_grain", {0.1, 0}), 0.02, {0, 0, std::numbers::pi / 2});
    turned.Play(kStrafeLeft, 1);
    EXPECT_NEAR(turned.state.pose.x_m, -1.1 * kFull_mps, 1e-12);
}

TEST(CarpetGrain, LeavesTurnsOnTheSpotAlone)
{
    Player player(With("carpet_grain", {0.3, 0.2}), 0.02);
    player.Play(kTurnLeft, 1);
    EXPECT_NEAR(player.state.pose.theta_rad, kFull_mps / kLever_m, 1e-12);
}

}  // namespace
}  // namespace twin::test

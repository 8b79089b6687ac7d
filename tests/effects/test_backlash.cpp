// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

constexpr double kRadius_m = 0.0325, kGap_rad = 0.2;

// The first way forward and each turn round lose the gap once, however long the steps are.
TEST(Backlash, IsTakenUpOnceAtEachTurnRound)
{
    for (const double dt_s : {0.01, 0.1})
    {
        Player player(With("backlash", {kGap_rad}), dt_s);
        const double lost_m = kGap_rad * kRadius_m;
        player.Play(kForward, 1);
        EXPECT_NEAR(player.state.pose.x_m, kFull_mps - lost_m, 1e-12);
        player.Play(kStop, 0.5);
        player.Play(kForward, 1);
        EXPECT_NEAR(player.state.pose.x_m, 2 * kFull_mps - lost_m, 1e-12);
        player.Play(kBack, 1);
        EXPECT_NEAR(player.state.pose.x_m, kFull_mps, 1e-12);
    }
}

// Within the play the wheel stands, and the motor's angle goes on.
TEST(Backlash, StandsWithinThePlay)
{
    Player player(With("backlash", {kGap_rad}), 0.001);
    const double within_s = 0.9 * kGap_rad * kRadius_m / kFull_mps;
    player.Play(kForward, within_s);
    EXPECT_NEAR(player.state.pose.x_m, 0, 1e-12);
    EXPECT_NEAR(player.state.wheel_rad[0], 0.9 * kGap_rad, 0.02 * kGap_rad);
}

// Gears in a row: the second play opens when the first one is taken up.
TEST(Backlash, AddsToTheOneThatTheModelHas)
{
    Player player(With("backlash", {0.1}, With("backlash", {kGap_rad})), 0.01);
    player.Play(kForward, 1);
    EXPECT_NEAR(player.state.pose.x_m, kFull_mps - (0.1 + kGap_rad) * kRadius_m, 1e-12);
    player.Play(kBack, 1);
    EXPECT_NEAR(player.state.pose.x_m, 0, 1e-12);
}

// A turn on the spot drives two wheels back: their play is open already.
TEST(Backlash, IsEachWheelsOwn)
{
    Player player(With("backlash", {kGap_rad}), 0.01), free(With("backlash", {0}), 0.01);
    for (Player *each : {&player, &free})
        each->Play(kTurnLeft, 0.5);
    const double radps = free.state.pose.theta_rad / 0.5;
    const double rim_per_turn_m = kFull_mps / radps;
    // Half of the wheels lose the gap: the body turns by half of what it is worth.
    EXPECT_NEAR(free.state.pose.theta_rad - player.state.pose.theta_rad,
                kGap_rad * kRadius_m / rim_per_turn_m / 2, 1e-9);
}

}  // namespace
}  // namespace twin::test

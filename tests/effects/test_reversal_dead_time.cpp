// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

// A reversal loses the speed of the dead time, whatever part of a step it is.
TEST(ReversalDeadTime, HoldsAWheelForExactlyThatLong)
{
    for (const double dead_s : {1e-4, 0.013, 0.05, 0.2})
        for (const double dt_s : {0.005, 0.02, 0.05})
        {
            Player player(With("reversal_dead_time", {dead_s}), dt_s);
            player.Play(kForward, 1);
            player.Play(Scaled(kBack, 0.5), 1);
            EXPECT_NEAR(player.state.pose.x_m, kFull_mps * (1 - 0.5 * (1 - dead_s)), 1e-12);
        }
}

TEST(ReversalDeadTime, DoesNotHoldAStartNorAChangeOfSpeed)
{
    Player player(With("reversal_dead_time", {0.1}), 0.02);
    player.Play(kStop, 1);
    player.Play(kBack, 1);
    player.Play(Scaled(kBack, 0.5), 1);
    player.Play(kStop, 1);
    player.Play(kBack, 1);
    EXPECT_NEAR(player.state.pose.x_m, -2.5 * kFull_mps, 1e-12);
}

TEST(ReversalDeadTime, CountsAPauseBetween)
{
    for (const double pause_s : {0.04, 0.1, 0.5})
    {
        Player player(With("reversal_dead_time", {0.1}), 0.02);
        player.Play(kForward, 1);
        player.Play(kStop, pause_s);
        player.Play(kBack, 1);
        EXPECT_NEAR(player.state.pose.x_m, kFull_mps * std::max(0.0, 0.1 - pause_s), 1e-12);
    }
}

TEST(ReversalDeadTime, HoldsOnlyTheWheelsThatReverse)
{
    Player player(With("reversal_dead_time", {0.1}), 0.02);
    player.Play(kForward, 1);
    player.Play(kTurnLeft, 0.06);
    EXPECT_EQ(player.state.rim_mps[0], 0);
    EXPECT_NEAR(player.state.rim_mps[1], kFull_mps, 1e-12);
}

// Behind a delay that cuts steps at other times.
TEST(ReversalDeadTime, WorksWithADelayOnEitherSide)
{
    Player behind(With("reversal_dead_time", {0.05}, With("input_delay", {0.033})), 0.02);
    Player before(With("input_delay", {0.033}, With("reversal_dead_time", {0.05})), 0.02);
    for (Player *player : {&behind, &before})
    {
        player->Play(kForward, 1);
        player->Play(kBack, 1);
        EXPECT_NEAR(player->state.pose.x_m, kFull_mps * (1 - (1 - 0.033 - 0.05)), 1e-12);
    }
}

}  // namespace
}  // namespace twin::test

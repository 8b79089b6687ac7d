// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

// The way is v t less v loss lasts; both edges are symmetric and take nothing from the sum.
TEST(TransientLoss, TakesItsShareOfTheWayWhileItLasts)
{
    for (const double loss : {0.3, -0.3})
        for (const double lasts_s : {1.5, 4.0})
        {
            Player player(With("transient_loss", {loss, 3, 3 + lasts_s}), 0.02);
            player.Play(kForward, 10);
            EXPECT_NEAR(player.state.pose.x_m, kFull_mps * (10 - loss * lasts_s), 1e-6);
        }
}

TEST(TransientLoss, LeavesNoTraceAfterwards)
{
    Player player(With("transient_loss", {0.4, 1, 3}), 0.02);
    player.Play(kTurnLeft, 5);
    const double turned_rad = player.state.pose.theta_rad;
    player.Play(kTurnLeft, 1);
    EXPECT_NEAR(player.state.pose.theta_rad - turned_rad, kFull_mps / kLever_m, 1e-4);
}

}  // namespace
}  // namespace twin::test

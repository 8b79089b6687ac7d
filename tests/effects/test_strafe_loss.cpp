// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(StrafeLoss, LeavesPurelyForwardAndSidewaysMotionAlone)
{
    for (const Wheels &way : {kForward, kBack, kStrafeLeft, Scaled(kStrafeLeft, -1)})
    {
        Player player(With("strafe_loss", {0.4}), 0.02);
        player.Play(way, 1);
        EXPECT_NEAR(std::hypot(player.state.pose.x_m, player.state.pose.y_m), kFull_mps, 1e-12);
    }
}

// At 45 degrees all of it, at 30 and 60 degrees sin^2 = 3/4 of it.
TEST(StrafeLoss, TakesSidewaysSpeedOnDiagonals)
{
    const struct
    {
        double tangent, part;
    } cases[] = {{1, 1}, {-1, 1}, {std::sqrt(3), 0.75}, {1 / std::sqrt(3), 0.75}};
    const auto effect = MakeAlone("strafe_loss", {0.4});
    for (const auto &c : cases)
    {
        Signals s;
        s.vx_mps = 0.2;
        s.vy_mps = 0.2 * c.tangent;
        effect.Step(s, nullptr);
        EXPECT_EQ(s.vx_mps, 0.2);
        EXPECT_NEAR(s.vy_mps, 0.2 * c.tangent * (1 - 0.4 * c.part), 1e-15);
    }
}

}  // namespace
}  // namespace twin::test

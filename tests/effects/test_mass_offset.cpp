// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

constexpr double kX_m = 0.01, kY_m = -0.02, kArm2_m2 = 0.1 * 0.1;

// Turning on the spot, the robot turns about the point (x, y) of its body: its centre is where a
// rigid body that holds that point has it.
TEST(MassOffset, TurnsOnTheSpotAboutItsPoint)
{
    Player player(With("mass_offset", {kX_m, kY_m}), 0.02);
    player.Play(kTurnLeft, 1);
    const double theta_rad = kFull_mps / kLever_m;
    const double c = std::cos(theta_rad), d = std::sin(theta_rad);
    EXPECT_NEAR(player.state.pose.theta_rad, theta_rad, 1e-12);
    EXPECT_NEAR(player.state.pose.x_m, kX_m - (c * kX_m - d * kY_m), 1e-12);
    EXPECT_NEAR(player.state.pose.y_m, kY_m - (d * kX_m + c * kY_m), 1e-12);
}

// What marker_offset cannot do. Drag left of the centre turns a forward drive left, drag ahead of
// it turns a drive to the left to the right.
TEST(MassOffset, TurnsStraightDrives)
{
    Player forward(With("mass_offset", {kX_m, -kY_m}), 0.02),
        left(With("mass_offset", {kX_m, -kY_m}), 0.02);
    forward.Play(kForward, 1);
    left.Play(kStrafeLeft, 1);
    EXPECT_NEAR(forward.state.pose.theta_rad, -kY_m * kFull_mps / kArm2_m2, 1e-12);
    EXPECT_NEAR(left.state.pose.theta_rad, -kX_m * kFull_mps / kArm2_m2, 1e-12);
}

}  // namespace
}  // namespace twin::test

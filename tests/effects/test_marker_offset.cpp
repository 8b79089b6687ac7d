// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <numbers>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(MarkerOffset, DrawsACircleOfItsRadiusOnATurnOnTheSpot)
{
    Player player(With("marker_offset", {0.03, 0.04}), 0.02, {1, 2, 0});
    double turned_rad = 0, last_rad = std::atan2(0.04, 0.03);
    for (int step = 0; step < 200; ++step)
    {
        player.Play(Scaled(kTurnLeft, 0.5), 0.02);
        const Pose2 seen = player.Seen();
        EXPECT_NEAR(std::hypot(seen.x_m - 1, seen.y_m - 2), 0.05, 1e-12);
        const double at_rad = std::atan2(seen.y_m - 2, seen.x_m - 1);
        turned_rad += std::remainder(at_rad - last_rad, 2 * std::numbers::pi);
        last_rad = at_rad;
    }
    EXPECT_NEAR(turned_rad, 4 * 0.5 * kFull_mps / kLever_m, 1e-9);
    EXPECT_EQ(player.Seen().theta_rad, player.state.pose.theta_rad);
}

// x is ahead and y to the left of the robot.
TEST(MarkerOffset, TurnsWithTheRobot)
{
    const DriveChain chain(With("marker_offset", {0.03, 0.04}));
    double t_s = 5;
    Pose2 east{0, 0, 0}, north{0, 0, std::numbers::pi / 2};
    chain.Observe(east, t_s);
    chain.Observe(north, t_s);
    EXPECT_NEAR(east.x_m, 0.03, 1e-15);
    EXPECT_NEAR(east.y_m, 0.04, 1e-15);
    EXPECT_NEAR(north.x_m, -0.04, 1e-15);
    EXPECT_NEAR(north.y_m, 0.03, 1e-15);
    EXPECT_EQ(t_s, 5);
}

TEST(MarkerOffset, IsTakenBackByInvert)
{
    const DriveChain chain(With("marker_offset", {-0.1, 0.2}));
    for (double theta_rad = -4; theta_rad < 4; theta_rad += 0.5)
    {
        Pose2 pose{0.5, -0.7, theta_rad};
        double t_s = 0;
        chain.Observe(pose, t_s);
        chain.Invert(pose, t_s);
        EXPECT_NEAR(pose.x_m, 0.5, 1e-15);
        EXPECT_NEAR(pose.y_m, -0.7, 1e-15);
    }
}

}  // namespace
}  // namespace twin::test

// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(ReverseAsymmetry, LeavesForwardDrivesAlone)
{
    Player with(With("reverse_asymmetry", {0.2, -0.1}), 0.02), without(Model(), 0.02);
    for (Player *player : {&with, &without})
        player->Play({0.4, 0.9, 0.4, 0.9}, 1);
    EXPECT_EQ(with.state.pose.x_m, without.state.pose.x_m);
    EXPECT_EQ(with.state.pose.theta_rad, without.state.pose.theta_rad);
}

TEST(ReverseAsymmetry, ChangesTheSpeedStraightBack)
{
    Player player(With("reverse_asymmetry", {0.1, 0.1}), 0.02);
    player.Play(kBack, 1);
    EXPECT_NEAR(player.state.pose.x_m, -1.1 * kFull_mps, 1e-12);
}

// Left wheels at -(1 + l) v, right ones at -(1 + r) v: turn rate (l - r) v / (2 lever).
TEST(ReverseAsymmetry, CurvesBackwardsByTheDifferenceOfItsSides)
{
    Player player(With("reverse_asymmetry", {0.12, 0.02}), 0.02);
    player.Play(kBack, 1);
    EXPECT_NEAR(player.state.pose.theta_rad, 0.1 * kFull_mps / (2 * kLever_m), 1e-12);
    EXPECT_NEAR(player.state.vx_mps, -1.07 * kFull_mps, 1e-12);
}

// Turning left, the left wheels alone run backwards.
TEST(ReverseAsymmetry, ActsOnOneSideOfATurn)
{
    Player left(With("reverse_asymmetry", {0.2, 0}), 0.02),
        right(With("reverse_asymmetry", {0.2, 0}), 0.02);
    left.Play(kTurnLeft, 1);
    right.Play(Scaled(kTurnLeft, -1), 1);
    EXPECT_NEAR(left.state.pose.theta_rad, 1.1 * kFull_mps / kLever_m, 1e-12);
    EXPECT_NEAR(right.state.pose.theta_rad, -kFull_mps / kLever_m, 1e-12);
}

// Three wheels that all lose a tenth in reverse turn a tenth slower that way.
TEST(ReverseAsymmetry, SlowsThreeWheelsAlikeWhereBothSidesAreAlike)
{
    Model model;
    model.base.wheels = WheelKind::kOmni3;
    model.base.drive = Drive::kWheelSpeed;
    Player player(With("reverse_asymmetry", {-0.1, -0.1}, model), 0.02);
    player.Play({-10, -10, -10, 0}, 0.02);
    EXPECT_NEAR(player.state.omega_radps,
                -9 * model.robot.wheel_radius_m / model.robot.half_track_m, 1e-12);
}

}  // namespace
}  // namespace twin::test

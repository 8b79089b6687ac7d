// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <numbers>

#include "drive.h"

namespace twin::test
{
namespace
{

// Left wheels slower by g, right ones faster: the circle's radius is lever / g, once round it the
// robot is back where it began.
TEST(WheelGain, LeftAndRightGiveACircleOfKnownRadius)
{
    const double g = 0.2, radius_m = kLever_m / g;
    const double round_s = 2 * std::numbers::pi * radius_m / kFull_mps;
    Player player(With("wheel_gain", {-g, g, -g, g}), round_s / 400);
    player.Play(kForward, round_s / 2);
    EXPECT_NEAR(player.state.pose.x_m, 0, 1e-12);
    EXPECT_NEAR(player.state.pose.y_m, 2 * radius_m, 1e-12);
    EXPECT_NEAR(player.state.pose.theta_rad, std::numbers::pi, 1e-12);
    player.Play(kForward, round_s / 2);
    EXPECT_NEAR(player.state.pose.x_m, 0, 1e-12);
    EXPECT_NEAR(player.state.pose.y_m, 0, 1e-12);
}

// On a differential drive the lever is half the track.
TEST(WheelGain, CircleOfADifferentialDrive)
{
    const double g = 0.2;
    Model model;
    model.base.wheels = WheelKind::kDifferential;
    Player player(With("wheel_gain", {-g, g, -g, g}, model), 0.02);
    player.Play(kForward, 1);
    EXPECT_NEAR(player.state.vx_mps / player.state.omega_radps, model.robot.half_track_m / g,
                1e-12);
}

TEST(WheelGain, DiagonalPairsGiveSidewaysMotion)
{
    Player player(With("wheel_gain", {-0.1, 0.1, 0.1, -0.1}), 0.02);
    player.Play(kForward, 1);
    EXPECT_NEAR(player.state.pose.x_m, kFull_mps, 1e-12);
    EXPECT_NEAR(player.state.pose.y_m, 0.1 * kFull_mps, 1e-12);
    EXPECT_NEAR(player.state.pose.theta_rad, 0, 1e-12);
}

TEST(WheelGain, EachNumberIsItsOwnWheel)
{
    Player player(With("wheel_gain", {0.1, 0.2, 0.3, 0.4}), 0.02);
    player.Play(kForward, 0.02);
    for (size_t k = 0; k < kMaxWheels; ++k)
        EXPECT_NEAR(player.state.rim_mps[k], kFull_mps * (1.1 + 0.1 * static_cast<double>(k)),
                    1e-12);
}

}  // namespace
}  // namespace twin::test

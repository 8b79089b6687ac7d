// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

constexpr double kDriftX_mps = 0.02, kDriftY_mps = -0.01;

TEST(FloorTilt, AddsDriftTimesTimeAtEveryHeading)
{
    for (const double theta_rad : {0.0, 1.0, 2.5, -2.0})
    {
        Player player(With("floor_tilt", {kDriftX_mps, kDriftY_mps}), 0.02, {1, 2, theta_rad});
        player.Play(kForward, 2);
        const double way_m = 2 * kFull_mps;
        EXPECT_NEAR(player.state.pose.x_m, 1 + way_m * std::cos(theta_rad) + 2 * kDriftX_mps,
                    1e-12);
        EXPECT_NEAR(player.state.pose.y_m, 2 + way_m * std::sin(theta_rad) + 2 * kDriftY_mps,
                    1e-12);
        EXPECT_NEAR(player.state.pose.theta_rad, theta_rad, 1e-12);
    }
}

// A step's chord is shorter than its arc by sin(a) / a, a = half the angle turned in the step:
// a^2 / 6 of the drift is missing. Here a = 0.02 at the long step, so 7e-5, and a quarter at half.
TEST(FloorTilt, DriftsWhileTurningOnTheSpot)
{
    double missing_m[2];
    for (int i = 0; i < 2; ++i)
    {
        const double dt_s = i ? 0.007 : 0.014, omega_radps = kFull_mps / kLever_m;
        Player player(With("floor_tilt", {kDriftX_mps, kDriftY_mps}), dt_s);
        player.Play(kTurnLeft, 2.1);
        missing_m[i] = 2.1 * kDriftX_mps - player.state.pose.x_m;
        const double a = omega_radps * dt_s / 2;
        EXPECT_NEAR(missing_m[i], 2.1 * kDriftX_mps * a * a / 6, 1e-9);
        EXPECT_NEAR(player.state.pose.y_m, 2.1 * kDriftY_mps * (1 - a * a / 6), 1e-9);
        EXPECT_NEAR(player.state.pose.theta_rad, 2.1 * omega_radps, 1e-12);
    }
    EXPECT_NEAR(missing_m[0] / missing_m[1], 4, 0.01);
}

TEST(FloorTilt, DoesNotMoveARobotThatStands)
{
    Player player(With("floor_tilt", {kDriftX_mps, kDriftY_mps}), 0.02);
    player.Play(kStop, 2);
    EXPECT_EQ(player.state.pose.x_m, 0);
    EXPECT_EQ(player.state.pose.y_m, 0);
}

// A first-order stop takes ln(0.36 / 0.001) = 6 time constants to slow below 1 mm/s.
TEST(FloorTilt, EndsSoonAfterALaggingRobotIsStopped)
{
    Player player(With("floor_tilt", {kDriftX_mps, kDriftY_mps}, Lagging(0.05)), 0.02);
    player.Play(kForward, 1);
    player.Play(kStop, 0.4);
    const double y_m = player.state.pose.y_m;
    player.Play(kStop, 5);
    EXPECT_EQ(player.state.pose.y_m, y_m);
}

}  // namespace
}  // namespace twin::test

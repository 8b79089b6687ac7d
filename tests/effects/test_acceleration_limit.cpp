// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

Player Ramped(double acceleration_mps2, double turn_radps2, double dt_s)
{
    Model model;
    model.base.drive = Drive::kTwist;
    return Player(With("acceleration_limit", {1 / acceleration_mps2, 1 / turn_radps2}, model),
                  dt_s);
}

// From rest to speed v the way lost is v^2 / (2 a), in any step, and it is gained while stopping.
TEST(AccelerationLimit, LosesTheWayOfTheRampAndGainsItWhileStopping)
{
    for (const double dt_s : {0.005, 0.02, 0.1})
    {
        Player player = Ramped(0.8, 4, dt_s);
        player.Play({0.4, 0, 0}, 1);
        EXPECT_NEAR(player.state.pose.x_m, 0.4 - 0.4 * 0.4 / (2 * 0.8), 1e-12);
        player.Play(kStop, 1);
        EXPECT_NEAR(player.state.pose.x_m, 0.4, 1e-12);
    }
}

// theta(t) = alpha t^2 / 2 up to the rate that was told.
TEST(AccelerationLimit, TurnsUpSteadily)
{
    Player player = Ramped(1, 5, 0.02);
    for (int step = 1; step <= 20; ++step)
    {
        player.Play({0, 0, 2}, 0.02);
        const double t_s = 0.02 * step;
        EXPECT_NEAR(player.state.pose.theta_rad, 5 * t_s * t_s / 2, 1e-12);
    }
}

TEST(AccelerationLimit, LeavesWhatHasNoLimitAsItIs)
{
    Model model;
    model.base.drive = Drive::kTwist;
    Player player(With("acceleration_limit", {0, 1}, model), 0.02);
    player.Play({0.3, 0.1, 0}, 0.02);
    EXPECT_NEAR(player.state.pose.x_m, 0.006, 1e-12);
    EXPECT_NEAR(player.state.pose.y_m, 0.002, 1e-12);
}

}  // namespace
}  // namespace twin::test

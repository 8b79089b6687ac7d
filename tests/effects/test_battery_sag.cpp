// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

// A DC motor's no-load speed is proportional to its voltage: 80 % of the voltage, 80 % of the way.
TEST(BatterySag, AtStrengthOneSpeedFollowsVoltage)
{
    for (const auto &[strength, expected] : {std::pair{1.0, 0.8}, {0.5, 0.9}, {2.0, 0.6}})
    {
        Player full(With("battery_sag", {strength}), 0.02),
            low(With("battery_sag", {strength}), 0.02);
        full.Play(kForward, 1, 7.4);
        low.Play(kForward, 1, 0.8 * 7.4);
        EXPECT_NEAR(low.state.pose.x_m / full.state.pose.x_m, expected, 1e-12);
    }
}

TEST(BatterySag, AFullerBatteryIsFaster)
{
    Player player(With("battery_sag", {1}), 0.02);
    player.Play(kForward, 1, 8.14);
    EXPECT_NEAR(player.state.pose.x_m, 1.1 * kFull_mps, 1e-12);
}

// 0 V in a command means that the voltage was not logged.
TEST(BatterySag, DoesNothingWithoutAVoltage)
{
    Player player(With("battery_sag", {1}), 0.02);
    player.Play(kForward, 1, 0);
    EXPECT_NEAR(player.state.pose.x_m, kFull_mps, 1e-12);
}

}  // namespace
}  // namespace twin::test

// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

Player Limited(double limit_mps)
{
    return Player(With("speed_limit", {1 / limit_mps}), 0.02);
}

TEST(SpeedLimit, CutsSpeedAndKeepsDirectionAndTurnRate)
{
    Player player = Limited(0.25);
    player.Play({0.3, 0.4, 0.5}, 0.02);  // 0.5 m/s
    EXPECT_NEAR(player.state.vx_mps, 0.15, 1e-12);
    EXPECT_NEAR(player.state.vy_mps, 0.2, 1e-12);
    EXPECT_NEAR(player.state.omega_radps, 0.5, 1e-12);
}

TEST(SpeedLimit, LeavesSlowerCommandsAsTheyAre)
{
    Player player = Limited(0.25);
    player.Play({-0.2, 0.1, 1.5}, 0.02);
    EXPECT_NEAR(player.state.vx_mps, -0.2, 1e-12);
    EXPECT_NEAR(player.state.vy_mps, 0.1, 1e-12);
}

}  // namespace
}  // namespace twin::test

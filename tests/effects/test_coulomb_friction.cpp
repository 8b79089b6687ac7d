// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

// Far above the fading speed, 22 mm/s here, tanh is 1 but for 2 exp(-2 * 0.09 / 0.022) = 6e-4.
TEST(CoulombFriction, TakesTheSameSpeedInEveryDirectionAndAtEverySpeed)
{
    for (const Wheels &way : {kForward, kBack, kStrafeLeft})
        for (const double duty : {0.25, 0.5, 1.0})
        {
            Player player(With("coulomb_friction", {0.01}), 0.02);
            player.Play(Scaled(way, duty), 1);
            EXPECT_NEAR(std::hypot(player.state.pose.x_m, player.state.pose.y_m),
                        duty * kFull_mps - 0.01, 1e-5);
        }
}

TEST(CoulombFriction, KeepsTheDirectionOfTravel)
{
    Player player(With("coulomb_friction", {0.05}), 0.02);
    player.Play({0.2, 0.8, 0.8, 0.2}, 0.02);
    EXPECT_NEAR(player.state.vy_mps / player.state.vx_mps, 0.6,
                1e-12);  // (0.8 - 0.2) / (0.8 + 0.2)
}

TEST(CoulombFriction, NeverTurnsTheMotionRoundNorMovesARobotThatStands)
{
    const auto effect = MakeAlone("coulomb_friction", {0.3});
    for (double v_mps = 0; v_mps < 1; v_mps += 0.01)
    {
        Signals s;
        s.vy_mps = v_mps;
        effect.Step(s, nullptr);
        EXPECT_GE(s.vy_mps, 0);
        EXPECT_LE(s.vy_mps, v_mps);
    }
}

}  // namespace
}  // namespace twin::test

// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

// First order from rest: v(t) = v (1 - exp(-t / tau)), x(t) = v (t - tau (1 - exp(-t / tau))).
TEST(MotorLag, GivesAFirstOrderStepResponse)
{
    for (const double tau_s : {0.01, 0.05, 0.3})
        for (const double dt_s : {0.004, 0.022, 0.1})
        {
            Player player(With("motor_lag", {tau_s}), dt_s);
            for (int step = 1; step < 30; ++step)
            {
                player.Play(kForward, dt_s);
                const double t_s = step * dt_s, part = 1 - std::exp(-t_s / tau_s);
                EXPECT_NEAR(player.state.rim_mps[0], kFull_mps * part, 1e-12);
                EXPECT_NEAR(player.state.pose.x_m, kFull_mps * (t_s - tau_s * part), 1e-12);
            }
        }
}

TEST(MotorLag, AddsToTheModelsOwn)
{
    Player split(With("motor_lag", {0.03}, Lagging(0.05)), 0.02), whole(Lagging(0.08), 0.02);
    split.Play(kForward, 0.1);
    whole.Play(kForward, 0.1);
    EXPECT_NEAR(split.state.pose.x_m, whole.state.pose.x_m, 1e-12);
}

TEST(MotorLag, CanTakeAwayTheModelsOwnButNoMore)
{
    Player player(With("motor_lag", {-0.2}, Lagging(0.05)), 0.02);
    player.Play(kForward, 0.1);
    EXPECT_NEAR(player.state.pose.x_m, kFull_mps * 0.1, 1e-12);
}

// The way from v to rest is the integral of v exp(-t / tau): v tau.
TEST(MotorLag, RollsOnForSpeedTimesLag)
{
    Player player(With("motor_lag", {0.05}), 0.02);
    player.Play(kForward, 2);
    const double start_m = player.state.pose.x_m;
    player.Play(kStop, 2);
    EXPECT_NEAR(player.state.pose.x_m - start_m, kFull_mps * 0.05, 1e-12);
}

}  // namespace
}  // namespace twin::test

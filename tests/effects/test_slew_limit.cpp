// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

// From rest to duty u the ramp takes u ramp: the way lost is v u ramp / 2, in any step.
TEST(SlewLimit, LosesHalfTheRampOnTheWayUpAndGainsItOnTheWayDown)
{
    for (const double ramp_s : {0.001, 0.033, 0.3})
        for (const double dt_s : {0.005, 0.02, 0.1})
            for (const double duty : {1.0, -0.5})
            {
                Player player(With("slew_limit", {ramp_s}), dt_s);
                player.Play(Scaled(kForward, duty), 1);
                const double v_mps = duty * kFull_mps, lost_s = std::abs(duty) * ramp_s / 2;
                EXPECT_NEAR(player.state.pose.x_m, v_mps * (1 - lost_s), 1e-12);
                player.Play(kStop, 1);
                EXPECT_NEAR(player.state.pose.x_m, v_mps, 1e-12);
            }
}

// On the ramp duty is t / ramp: x(t) = v t^2 / (2 ramp).
TEST(SlewLimit, AcceleratesSteadily)
{
    Player player(With("slew_limit", {0.5}), 0.02);
    for (int step = 1; step <= 25; ++step)
    {
        player.Play(kForward, 0.02);
        const double t_s = 0.02 * step;
        EXPECT_NEAR(player.state.pose.x_m, kFull_mps * t_s * t_s / (2 * 0.5), 1e-12);
    }
}

TEST(SlewLimit, TakesTwiceAsLongThroughZero)
{
    Player player(With("slew_limit", {0.3}), 0.02);
    player.Play(kForward, 1);
    const double x_m = player.state.pose.x_m;
    player.Play(kBack, 0.6);
    EXPECT_NEAR(player.state.pose.x_m, x_m, 1e-12);
    player.Play(kBack, 0.02);
    EXPECT_NEAR(player.state.rim_mps[0], -kFull_mps, 1e-12);
}

// A delay that cuts the steps does not make the ramp steeper.
TEST(SlewLimit, KeepsItsRampWhenADelayCutsSteps)
{
    Player player(With("slew_limit", {0.3}, With("input_delay", {0.033})), 0.02);
    player.Play(kForward, 1);
    EXPECT_NEAR(player.state.pose.x_m, kFull_mps * (1 - 0.033 - 0.15), 1e-12);
}

// A ramp and a delay may change places: neither depends on when it happens. However short the
// delay is, it does not cut the ramp.
TEST(SlewLimit, CommutesWithADelay)
{
    for (const double delay_s : {0.033, 1e-7})
    {
        Player ramp_last(With("slew_limit", {0.3}, With("input_delay", {delay_s})), 0.02);
        Player ramp_first(With("input_delay", {delay_s}, With("slew_limit", {0.3})), 0.02);
        for (Player *player : {&ramp_last, &ramp_first})
        {
            player->Play(kForward, 1);
            EXPECT_NEAR(player->state.pose.x_m, kFull_mps * (1 - delay_s - 0.15), 1e-12);
        }
    }
}

}  // namespace
}  // namespace twin::test

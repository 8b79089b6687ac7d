// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

// Constant deceleration a from speed v: stops after v / a on a way of v^2 / (2 a).
TEST(Coasting, StopsInTheTimeAndOnTheWayOfAConstantDeceleration)
{
    for (const double a_mps2 : {0.3, 0.7, 2.0})
        for (const double dt_s : {0.01, 0.022, 0.07})
            for (const double sign : {1.0, -1.0})
            {
                Player player(With("coasting", {a_mps2}), dt_s);
                player.Play(Scaled(kForward, sign), 10 * dt_s);
                const double start_m = player.state.pose.x_m, stop_s = kFull_mps / a_mps2;
                double way_m = 0, rolled_s = 0;
                while (rolled_s < stop_s + 2 * dt_s)
                {
                    player.Play(kStop, dt_s);
                    rolled_s += dt_s;
                    const double left_mps = std::max(0.0, kFull_mps - a_mps2 * rolled_s);
                    EXPECT_NEAR(player.state.rim_mps[0], sign * left_mps, 1e-12);
                    way_m = player.state.pose.x_m - start_m;
                }
                EXPECT_NEAR(way_m, sign * kFull_mps * kFull_mps / (2 * a_mps2), 1e-12);
                EXPECT_EQ(player.state.rim_mps, Wheels{});
            }
}

TEST(Coasting, TakesTheLagsPlaceAtZeroDutyOnly)
{
    Player coasting(With("coasting", {0.5}, Lagging(0.1)), 0.02), braking(Lagging(0.1), 0.02);
    for (Player *player : {&coasting, &braking})
    {
        player->Play(kForward, 1);
        player->Play(Scaled(kForward, 0.4), 1);
    }
    EXPECT_EQ(coasting.state.pose.x_m, braking.state.pose.x_m);
    const double v_mps = coasting.state.rim_mps[0], start_m = coasting.state.pose.x_m;
    coasting.Play(kStop, 2);
    EXPECT_NEAR(coasting.state.pose.x_m - start_m, v_mps * v_mps / (2 * 0.5), 1e-12);
}

// dv/dt = -(a + b v): v(t) = (v + a / b) exp(-b t) - a / b, and the way to rest is
// (v - a / b ln(1 + b v / a)) / b. The step takes the drag at its middle: second order.
TEST(Coasting, WithDragSlowsExponentiallyTowardsBelowRest)
{
    const double a_mps2 = 0.5, b_per_s = 3, v_mps = kFull_mps, dt_s = 0.01;
    Player player(With("coasting", {a_mps2, b_per_s}), dt_s);
    player.Play(kForward, 1);
    const double start_m = player.state.pose.x_m;
    player.Play(kStop, 0.2);
    const double floor_mps = a_mps2 / b_per_s;
    EXPECT_NEAR(player.state.rim_mps[0], (v_mps + floor_mps) * std::exp(-b_per_s * 0.2) - floor_mps,
                1e-4);
    player.Play(kStop, 2);
    EXPECT_NEAR(player.state.pose.x_m - start_m,
                (v_mps - floor_mps * std::log(1 + v_mps / floor_mps)) / b_per_s, 2e-5);
    EXPECT_EQ(player.state.rim_mps, Wheels{});
}

// Each wheel by itself: those that are still driven turn on.
TEST(Coasting, ActsPerWheel)
{
    Player player(With("coasting", {1}), 0.02);
    player.Play(kForward, 0.2);
    player.Play({0, 1, 0, 1}, 0.1);
    EXPECT_NEAR(player.state.rim_mps[0], kFull_mps - 0.1, 1e-12);
    EXPECT_NEAR(player.state.rim_mps[1], kFull_mps, 1e-12);
}

}  // namespace
}  // namespace twin::test

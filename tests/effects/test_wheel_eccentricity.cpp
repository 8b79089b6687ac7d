// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <numbers>

#include "drive.h"

namespace twin::test
{
namespace
{

constexpr double kRadius_m = 0.0325;

// With all wheels alike the robot goes straight: from phi = 0, at speed v = r w,
// x(t) = v t + r (C sin(w t) + S (1 - cos(w t))).
TEST(WheelEccentricity, RipplesOnceInATurnOfTheWheel)
{
    const double c = 0.1, s = -0.05;
    for (const double dt_s : {0.02, 0.1})
    {
        Player player(With("wheel_eccentricity", {c, s, c, s, c, s, c, s}), dt_s);
        for (int step = 1; step < 30; ++step)
        {
            player.Play(kForward, dt_s);
            const double way_m = kFull_mps * step * dt_s, phi_rad = way_m / kRadius_m;
            EXPECT_NEAR(player.state.pose.x_m,
                        way_m + kRadius_m * (c * std::sin(phi_rad) + s * (1 - std::cos(phi_rad))),
                        1e-12);
            EXPECT_NEAR(player.state.wheel_rad[2], phi_rad, 1e-12);
        }
    }
}

// The same on wheels of 1.2 times the radius, which the rims' speeds do not tell.
TEST(WheelEccentricity, RipplesMoreSlowlyOnLargerWheels)
{
    const double c = 0.1, s = -0.05, ratio = 1.2, dt_s = 0.02;
    Player player(With("wheel_eccentricity", {c, s, c, s, c, s, c, s, ratio}), dt_s);
    for (int step = 1; step < 30; ++step)
    {
        player.Play(kForward, dt_s);
        const double way_m = kFull_mps * step * dt_s, radius_m = ratio * kRadius_m;
        const double phi_rad = way_m / radius_m;
        EXPECT_NEAR(player.state.pose.x_m,
                    way_m + radius_m * (c * std::sin(phi_rad) + s * (1 - std::cos(phi_rad))),
                    1e-12);
    }
}

TEST(WheelEccentricity, LeavesTheWayOfWholeTurnsAndTheWheelsSpeedAlone)
{
    const double turn_s = 2 * std::numbers::pi * kRadius_m / kFull_mps;
    Player player(With("wheel_eccentricity", {0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1}),
                  turn_s / 32);
    player.Play(kForward, 3 * turn_s);
    EXPECT_NEAR(player.state.pose.x_m, 3 * turn_s * kFull_mps, 1e-12);
    EXPECT_NEAR(player.state.rim_mps[0], kFull_mps, 1e-15);
}

// Through a lag the angle is where the wheel has got to, tau v behind; the step's share of it is
// taken at its middle, second order.
TEST(WheelEccentricity, FollowsTheAngleOfALaggingWheel)
{
    const double c = 0.1, tau_s = 0.1, t_s = 0.5, dt_s = 0.005;
    Player player(With("wheel_eccentricity", {c, 0, c, 0, c, 0, c, 0}, Lagging(tau_s)), dt_s);
    player.Play(kForward, t_s);
    const double way_m = kFull_mps * (t_s - tau_s * (1 - std::exp(-t_s / tau_s)));
    EXPECT_NEAR(player.state.wheel_rad[0], way_m / kRadius_m, 1e-12);
    EXPECT_NEAR(player.state.pose.x_m, way_m + kRadius_m * c * std::sin(way_m / kRadius_m), 1e-5);
}

TEST(WheelEccentricity, EachPairIsItsOwnWheel)
{
    for (size_t k = 0; k < kMaxWheels; ++k)
    {
        std::vector<double> values(8, 0.0);
        values[2 * k] = 0.1;
        Signals s;
        s.dt_s = 1e-9;
        s.robot.wheel_radius_m = kRadius_m;
        MakeAlone("wheel_eccentricity", values).Step(s, nullptr);
        for (size_t other = 0; other < kMaxWheels; ++other)
            EXPECT_NEAR(s.radius_ratio[other], other == k ? 1.1 : 1, 1e-12);
    }
}

}  // namespace
}  // namespace twin::test

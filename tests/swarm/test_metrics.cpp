// SPDX-License-Identifier: Apache-2.0
// twin/swarm/metrics.cpp
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "swarm/metrics.h"

namespace twin
{
namespace
{

constexpr double kPi = std::numbers::pi;

// Robots on a ring, circling counter-clockwise for sign = 1.
std::vector<RobotState> Ring(int n, double radius_m, double sign, double speed_mps = 0.25)
{
    std::vector<RobotState> robots(static_cast<size_t>(n));
    for (int i = 0; i < n; ++i)
    {
        const double at_rad = 2 * kPi * i / n;
        RobotState &robot = robots[static_cast<size_t>(i)];
        robot.pose = {3 + radius_m * std::cos(at_rad), -2 + radius_m * std::sin(at_rad),
                      at_rad + sign * kPi / 2};
        robot.vx_mps = speed_mps;
        robot.omega_radps = sign * speed_mps / radius_m;
    }
    return robots;
}

TEST(Metrics, ARingIsPerfectAndTurns)
{
    const Metrics m = Measure(Ring(6, 0.5, -1), 6, {1.1, 0.1});
    EXPECT_NEAR(m.circliness, 0, 1e-12);
    EXPECT_NEAR(m.radius_m, 0.5, 1e-12);
    EXPECT_NEAR(m.scatter_m2, 0.25, 1e-12);
    EXPECT_NEAR(m.rotation, -1, 1e-12);
    EXPECT_EQ(m.groups, 1);
    EXPECT_EQ(m.contacts, 0);
    EXPECT_STREQ(Classify(m), "milling");
}

TEST(Metrics, CirclinessIsTheSpreadOfRadiiOverTheLeast)
{
    // Opposite pairs at 1 and 2 m keep the centroid: (2 - 1) / 1.
    std::vector<RobotState> cross(4);
    cross[0].pose.x_m = 1;
    cross[1].pose.x_m = -1;
    cross[2].pose.y_m = 2;
    cross[3].pose.y_m = -2;
    EXPECT_DOUBLE_EQ(Measure(cross, 4, {5, 0}).circliness, 1);
}

TEST(Metrics, BackwardsIsJudgedByTravelNotByHeading)
{
    auto robots = Ring(5, 0.5, 1);
    for (RobotState &robot : robots)
        robot.vx_mps = -0.25;
    EXPECT_NEAR(Measure(robots, 5, {1.1, 0}).rotation, -1, 1e-12);
}

// The centre of a unit circle stays where it is while a robot goes around.
TEST(Metrics, DiffusionComparesTurningCentresNotPositions)
{
    auto robots = Ring(2, 0.5, 1);
    EXPECT_NEAR(Measure(robots, 2, {1.1, 0}).diffusion, 0, 1e-12);
    for (RobotState &robot : robots)
        robot.vx_mps = robot.omega_radps = 0;
    EXPECT_NEAR(Measure(robots, 2, {0.5, 0}).diffusion, 2, 1e-12);
}

TEST(Metrics, StandingOrTouchingRingsAreNoMills)
{
    EXPECT_STREQ(Classify(Measure(Ring(6, 0.5, 1, 0), 6, {1.1, 0.1})), "jammed");
    // Six bodies of 0.1 m on a ring of 0.2 m touch their neighbours.
    const Metrics jam = Measure(Ring(6, 0.2, 1), 6, {1.1, 0.1});
    EXPECT_EQ(jam.contacts, 6);
    EXPECT_STREQ(Classify(jam), "jammed");
}

TEST(Metrics, GroupsAreCountedByViewRange)
{
    std::vector<RobotState> robots(5);
    for (size_t i = 0; i < 5; ++i)
        robots[i].pose.x_m = static_cast<double>(i) + (i > 2 ? 1 : 0);
    EXPECT_EQ(Measure(robots, 5, {1.1, 0}).groups, 2);
    EXPECT_EQ(Measure(robots, 5, {0.9, 0}).groups, 5);
}

TEST(Metrics, AnOddRobotIsMeasuredAgainstTheRing)
{
    auto robots = Ring(5, 0.5, -1);
    robots.push_back({});
    robots.back().pose = {3.1, -2, 0};
    const Metrics m = Measure(robots, 5, {1.1, 0.1});
    EXPECT_NEAR(m.circliness, 0, 1e-12);
    EXPECT_NEAR(m.odd_ratio, 0.2, 1e-12);
}

TEST(Metrics, OneRobotHasNoRing)
{
    const Metrics m = Measure(std::vector<RobotState>(1), 1, {1.1, 0.1});
    EXPECT_TRUE(std::isnan(m.circliness));
    EXPECT_TRUE(std::isnan(m.diffusion));
    EXPECT_STREQ(Classify(m), "undefined");
}

TEST(MetricWindow, ForgetsWhatIsOlderThanItself)
{
    MetricWindow window(2);
    for (int t_s = 1; t_s <= 10; ++t_s)
        window.Add(t_s, Metrics{.circliness = static_cast<double>(t_s)});
    EXPECT_DOUBLE_EQ(window.Mean().circliness, 9.5);
}

}  // namespace
}  // namespace twin

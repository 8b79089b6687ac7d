// SPDX-License-Identifier: Apache-2.0
// twin/swarm/recent_poses.cpp
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>

#include "swarm/recent_poses.h"

namespace twin
{
namespace
{

constexpr double kPi = std::numbers::pi;
constexpr MetricScale kScale{1.1, 0.1};

Ring All(size_t n)
{
    Ring ring{std::vector<size_t>(n), n};
    std::iota(ring.order.begin(), ring.order.end(), 0);
    return ring;
}

// Robots on a ring about (3, -2) that circle it; headings jump by a turn as published ones do.
RecentPoses Circling(int n, double radius_m, double turn_radps, double duration_s,
                     double late_s = 0)
{
    RecentPoses recent(n);
    for (double t_s = 0; t_s <= duration_s; t_s += 1 / 120.0)
        for (int i = 0; i < n; ++i)
        {
            const double at_rad = 2 * kPi * i / n + turn_radps * t_s;
            const double heading_rad = at_rad + std::copysign(kPi / 2, turn_radps);
            recent.Add(i, t_s + i * late_s,
                       {3 + radius_m * std::cos(at_rad), -2 + radius_m * std::sin(at_rad),
                        std::remainder(heading_rad, 2 * kPi)});
        }
    return recent;
}

TEST(RecentPoses, ARingThatTurnsIsFoundFromItsPosesAlone)
{
    for (const double turn_radps : {0.5, -0.8})
    {
        const Metrics m = Circling(6, 0.5, turn_radps, 25).Mean(All(6), kScale);
        EXPECT_NEAR(m.circliness, 0, 1e-3);
        EXPECT_NEAR(m.radius_m, 0.5, 1e-4);
        EXPECT_NEAR(m.rotation, std::copysign(1, turn_radps), 1e-3);
        // All turn about the ring's centre, so that no two centres are apart.
        EXPECT_NEAR(m.diffusion, 0, 0.01);
        EXPECT_EQ(m.contacts, 0);
        EXPECT_STREQ(Classify(m), "milling");
    }
}

TEST(RecentPoses, ARunShorterThanTheWindowIsJudgedAsAWhole)
{
    EXPECT_NEAR(Circling(6, 0.5, 0.5, 1).Mean(All(6), kScale).radius_m, 0.5, 1e-4);
}

TEST(RecentPoses, ClocksThatDifferAreReadWhereAllAreKnown)
{
    EXPECT_NEAR(Circling(4, 0.5, 0.5, 15, 0.05).Mean(All(4), kScale).radius_m, 0.5, 0.01);
}

TEST(RecentPoses, AnOddRobotMayHaveAnyNumber)
{
    const Pose2 poses[] = {{1, 0, 0}, {2, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
    RecentPoses recent(5);
    for (double t_s = 0; t_s <= 15; t_s += 1 / 120.0)
        for (int i = 0; i < 5; ++i)
            recent.Add(i, t_s, poses[i]);
    EXPECT_NEAR(recent.Mean({{0, 2, 3, 4, 1}, 4}, kScale).odd_ratio, 2, 1e-6);
}

TEST(RecentPoses, TooFewPosesTellNothing)
{
    EXPECT_STREQ(Classify(RecentPoses(3).Mean(All(3), kScale)), "undefined");
    EXPECT_STREQ(Classify(Circling(3, 0.5, 0.5, 0.3).Mean(All(3), kScale)), "undefined");
}

}  // namespace
}  // namespace twin

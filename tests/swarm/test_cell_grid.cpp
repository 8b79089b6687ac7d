// SPDX-License-Identifier: Apache-2.0
// twin/swarm/cell_grid: nobody near is forgotten, and results are those of all pairs, to the bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "paper_swarm.h"
#include "plant/random.h"
#include "sensor/cone_sensor.h"
#include "swarm/bodies.h"
#include "swarm/robots.h"
#include "swarm/starts.h"
#include "swarm/swarm.h"

namespace twin
{
namespace
{

std::vector<Pose2> Scatter(int n, double width_m, uint64_t seed)
{
    Random random(seed, 0, "test");
    std::vector<Pose2> poses;
    for (int i = 0; i < n; ++i)
        poses.push_back({width_m * random.Uniform(), 0.3 * width_m * random.Uniform() - 5,
                         6.3 * random.Uniform()});
    return poses;
}

TEST(CellGrid, FindsAllThatAreNearInAscendingOrder)
{
    CellGrid grid;
    for (uint64_t seed = 0; seed < 20; ++seed)
        for (const double width_m : {0.0, 0.5, 8.0, 1e4})
        {
            const auto poses = Scatter(60, width_m, seed);
            grid.Fill(poses, 0.7);
            for (size_t i = 0; i < poses.size(); ++i)
            {
                const auto &near = grid.Near(i);
                EXPECT_TRUE(std::ranges::is_sorted(near));
                EXPECT_EQ(std::ranges::adjacent_find(near), near.end());
                for (size_t j = 0; j < poses.size(); ++j)
                    if (std::hypot(poses[i].x_m - poses[j].x_m, poses[i].y_m - poses[j].y_m) < 0.7)
                    {
                        EXPECT_TRUE(std::ranges::binary_search(near, j)) << i << " " << j;
                    }
            }
        }
}

// A cell's edge at exactly the reach, where rounding could lose a neighbour.
TEST(CellGrid, NeighboursOnALatticeOfTheReachAreFound)
{
    CellGrid grid;
    std::vector<Pose2> row;
    for (int i = 0; i < 50; ++i)
        row.push_back({0.1 * i, 0, 0});
    grid.Fill(row, 0.1 + 1e-12);
    for (size_t i = 1; i < row.size(); ++i)
        EXPECT_TRUE(std::ranges::binary_search(grid.Near(i), i - 1)) << i;
}

TEST(CellGrid, BodiesArePushedAsByAllPairsToTheBit)
{
    CellGrid grid;
    for (const double friction : {0.0, 0.4})
        for (uint64_t seed = 0; seed < 10; ++seed)
        {
            const auto before = Scatter(200, 3, seed), now = Scatter(200, 3, seed + 1);
            std::vector<Body> bodies;
            for (size_t i = 0; i < now.size(); ++i)
                bodies.push_back({i % 3 ? 0.1 : 0.15, friction});
            auto brute = now, fast = now;
            PushApart(brute, before, bodies);
            PushApart(fast, before, bodies, &grid);
            int moved = 0;
            for (size_t i = 0; i < now.size(); ++i)
            {
                EXPECT_EQ(brute[i].x_m, fast[i].x_m);
                EXPECT_EQ(brute[i].y_m, fast[i].y_m);
                moved += brute[i].x_m != now[i].x_m;
            }
            EXPECT_GT(moved, 100);
        }
}

// Whom a hiding body stands before, and who is too far to matter, is the same with those left out.
TEST(CellGrid, SensorsSeeTheSameWithFarRobotsLeftOut)
{
    DetectionModel detection;
    detection.range_m = 1.1;
    detection.cone_rad = 0.9;
    int seen = 0;
    for (const double hide_m : {0.0, 0.1})
        for (uint64_t seed = 0; seed < 20; ++seed)
        {
            detection.hide_radius_m = hide_m;
            const auto poses = Scatter(80, 6, seed);
            CellGrid grid;
            grid.Fill(poses, detection.range_m);
            for (size_t i = 0; i < poses.size(); ++i)
            {
                const auto &near = grid.Near(i);
                std::vector<Pose2> some;
                for (const size_t j : near)
                    some.push_back(poses[j]);
                const auto self =
                    static_cast<size_t>(std::ranges::lower_bound(near, i) - near.begin());
                const std::array bits{fw_bit_default()};
                ConeSensor all(detection, bits, static_cast<int>(i), 1),
                    few(detection, bits, static_cast<int>(i), 1);
                const bool by_all = all.Next({poses, i}, 0)->bits;
                EXPECT_EQ(by_all, few.Next({some, self}, 0)->bits);
                seen += by_all;
            }
        }
    EXPECT_GT(seen, 300);
    EXPECT_LT(seen, 2900);
}

TEST(CellGrid, ASwarmRunsTheSameToTheBit)
{
    Model model = Model::Load("paper.toml");
    model.robot.body_radius_m = 0.1;
    model.sensor.false_negative_rate = 0.1;
    const auto robots = DrawRobots(model, 120, 3);
    const auto starts = StartPoses(StartShape::kSquare, 120, 6, 0.1, 3);
    const std::vector<fw_table> tables(120, fw_behavior_find("milling")->table);
    const auto make = [&](size_t from) {
        return Swarm(std::make_unique<PlanarBodies>(robots, starts, 3, from), robots, tables,
                     {.seed = 3, .grid_from = from});
    };
    Swarm brute = make(SIZE_MAX), fast = make(0);
    for (int step = 0; step < 300; ++step)
    {
        brute.Step();
        fast.Step();
    }
    for (int i = 0; i < 120; ++i)
    {
        EXPECT_EQ(brute.State(i).pose.x_m, fast.State(i).pose.x_m);
        EXPECT_EQ(brute.State(i).pose.y_m, fast.State(i).pose.y_m);
        EXPECT_EQ(brute.State(i).pose.theta_rad, fast.State(i).pose.theta_rad);
    }
}

}  // namespace
}  // namespace twin

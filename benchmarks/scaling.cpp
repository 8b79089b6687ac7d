// SPDX-License-Identifier: Apache-2.0
// What a swarm of n costs at a fixed density, in processor time of one thread. CSV on stdout: a
// robot's control step of the paper's model with bodies, by all pairs and with a grid; then how
// many times as fast as real time the TurboPi's model runs on both plants, sensors and firmware
// included.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>

#include "fw/behavior.h"
#include "plant_mujoco/mujoco_plant.h"
#include "swarm/bodies.h"
#include "swarm/robots.h"
#include "swarm/starts.h"
#include "swarm/swarm.h"

namespace
{

using namespace twin;

constexpr double kSideOfOne_m = 0.5;  // of the square for each robot
constexpr int kRepeats = 3;

double CpuS()
{
    timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Seconds for a step of all; the best of a few.
template <class MakePlant>
double StepCostS(const Model &model, int n, size_t grid_from, int steps, MakePlant make_plant)
{
    const auto robots = DrawRobots(model, n, 1);
    const double side_m = std::max(1.2, kSideOfOne_m * std::sqrt(n));
    const auto starts = StartPoses(StartShape::kSquare, n, side_m, model.robot.body_radius_m, 1);
    const std::vector<fw_table> tables(static_cast<size_t>(n), fw_behavior_find("milling")->table);
    double best_s = HUGE_VAL;
    for (int repeat = 0; repeat < kRepeats; ++repeat)
    {
        Swarm swarm(make_plant(robots, starts), robots, tables,
                    {.seed = 1, .grid_from = grid_from});
        const double begin_s = CpuS();
        for (int step = 0; step < steps; ++step)
            swarm.Step();
        best_s = std::min(best_s, (CpuS() - begin_s) / steps);
    }
    return best_s;
}

double PlanarCostS(const Model &model, int n, size_t grid_from)
{
    const int steps = std::max(5, static_cast<int>(60'000 / n / (n > 100 ? n / 100 : 1)));
    return StepCostS(model, n, grid_from, steps, [&](const auto &robots, const auto &starts) {
        return std::make_unique<PlanarBodies>(robots, starts, 1, grid_from);
    });
}

double MujocoCostS(const Model &model, int n)
{
    const int steps = std::max(5, 400 / n);
    return StepCostS(model, n, kGridPays, steps, [](const auto &robots, const auto &starts) {
        return std::make_unique<MujocoPlant>(FindModelFile("turbopi.xml"), robots, starts,
                                             MujocoOptions{});
    });
}

}  // namespace

int main()
{
    Model paper = Model::Load("paper.toml");
    paper.robot.body_radius_m = 0.1;
    paper.sensor.target_radius_m = 0.1;
    std::printf("robots,all_pairs_us,grid_us\n");
    for (const int n : {1, 3, 10, 20, 30, 50, 70, 100, 200, 300, 500, 1000})
        std::printf("%d,%.3f,%.3f\n", n, 1e6 * PlanarCostS(paper, n, SIZE_MAX) / n,
                    1e6 * PlanarCostS(paper, n, 0) / n);
    const Model turbopi = Model::Load("turbopi_nominal.toml");
    const double period_s = turbopi.base.control_period_s;
    std::printf("\nrobots,planar_times_real,mujoco_times_real\n");
    for (const int n : {1, 2, 5, 10, 20, 50, 100, 200})
    {
        std::printf("%d,%.4g,%.4g\n", n, period_s / PlanarCostS(turbopi, n, kGridPays),
                    period_s / MujocoCostS(turbopi, n));
        std::fflush(stdout);
    }
    return 0;
}

// SPDX-License-Identifier: Apache-2.0
// Agent-steps a second of processor time, one core, milling with 6 robots for 120 s: the sweep with
// starts, metrics and classes, against a bare kernel of the published equations and the full path.
#include <cstdio>
#include <ctime>
#include <random>

#include "fw/behavior.h"
#include "paper_kernel.h"
#include "sweep/batch.h"
#include "sweep/worlds.h"

namespace
{

constexpr double kStep_s = 0.022;
constexpr int kSteps = 5455, kRepeats = 5;  // 120 s

double CpuS()
{
    timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// Best of a few: other work on the machine only ever slows down.
template <class Work>
double Rate(double agent_steps, Work work)
{
    double best = 0;
    for (int repeat = 0; repeat < kRepeats; ++repeat)
    {
        const double begin_s = CpuS();
        work();
        best = std::max(best, agent_steps / (CpuS() - begin_s));
    }
    return best;
}

double BareRate()
{
    std::mt19937 random(1);
    std::uniform_real_distribution<float> place(-0.6f, 0.6f);
    PaperRobots robots;
    constexpr int kBatches = 40;
    return Rate(1.0 * kBatches * kPaperLanes * kPaperRobots * kSteps, [&] {
        for (int batch = 0; batch < kBatches; ++batch)
        {
            for (int i = 0; i < kPaperRobots; ++i)
                for (int lane = 0; lane < kPaperLanes; ++lane)
                {
                    robots.x[i][lane] = place(random);
                    robots.y[i][lane] = place(random);
                    robots.c[i][lane] = 1;
                    robots.s[i][lane] = 0;
                }
            RunPaperKernel(robots, kSteps);
        }
        volatile float used = robots.x[0][0];
        (void)used;
    });
}

double SweepRate(const twin::Cell &cell, int seeds, twin::Path path, int steps = kSteps)
{
    std::vector<twin::World> worlds;
    for (int seed = 1; seed <= seeds; ++seed)
        worlds.push_back({&cell, static_cast<uint64_t>(seed)});
    return Rate(1.0 * seeds * static_cast<double>(cell.tables.size()) * steps,
                [&] { twin::RunWorlds(worlds, steps * kStep_s, path); });
}

}  // namespace

int main(int argc, char **argv)
{
    const double other = argc > 1 ? std::atof(argv[1]) : 0;  // agent-steps a second of another
    const fw_table milling = fw_behavior_find("milling")->table;
    const twin::Cell paper{twin::Model::Load("paper.toml"), std::vector<fw_table>(6, milling), 6};
    twin::Cell robot = paper;
    robot.model.robot.body_radius_m = 0.1;
    robot.model.sensor.false_negative_rate = 0.04;
    robot.model.sensor.false_positive_rate = 0.1;
    robot.model.sensor.vote_frames = 10;

    const double bare = BareRate();
    const auto tell = [&](const char *what, double rate) {
        std::printf("%-44s %8.2f M/s, 1/%.1f of the bare kernel", what, rate / 1e6, bare / rate);
        if (other > 0)
            std::printf(", %.0f times the other", rate / other);
        std::printf("\n");
    };
    tell("bare kernel, single precision, no metrics", bare);
    tell("sweep, paper model", SweepRate(paper, 400, twin::Path::kBest));
    tell("sweep, paper model, 1200 s", SweepRate(paper, 80, twin::Path::kBest, 10 * kSteps));
    tell("sweep, bodies, errors, vote of 10", SweepRate(robot, 400, twin::Path::kBest));
    tell("full path, paper model", SweepRate(paper, 2, twin::Path::kFull));
    return 0;
}

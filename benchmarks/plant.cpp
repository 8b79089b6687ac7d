// SPDX-License-Identifier: Apache-2.0
// Eight robots in MuJoCo at 2 ms, driven at random: processor time against real time, and against
// robots with ten free rollers a wheel. The two run in turn.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <vector>

#include "../tests/plant/roller_robot.h"
#include "plant_mujoco/mujoco_plant.h"

namespace
{

constexpr int kRobots = 8, kRounds = 11;
constexpr double kRound_s = 0.5, kStep_s = 0.002, kMotor_Nms = 0.15;

double CpuS()
{
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double Median(std::vector<double> values)
{
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
}

}  // namespace

int main()
{
    using namespace twin;
    Model model;
    model.base.drive = Drive::kWheelSpeed;
    std::vector<Pose2> starts;
    for (int i = 0; i < kRobots; ++i)
        starts.push_back({0.3 * (i % 3), 0.3 * (i / 3), 0});
    MujocoPlant plant(FindModelFile("turbopi.xml"), std::vector<Model>(kRobots, model), starts, {});
    mjSpec *spec =
        mj_parseXMLString(RollerRobots(kRobots, kMotor_Nms).c_str(), nullptr, nullptr, 0);
    mjModel *m = mj_compile(spec, nullptr);
    mjData *d = mj_makeData(m);
    Random random(1, 0, "drive");
    std::vector<double> real_time, rollers;
    for (int round = 0; round < kRounds; ++round)
    {
        for (int i = 0; i < kRobots; ++i)
        {
            Command command;
            for (size_t k = 0; k < kMaxWheels; ++k)
                d->ctrl[4 * i + static_cast<int>(k)] = command.value[k] =
                    20 * random.Uniform() - 10;
            plant.SetCommand(i, command);
        }
        const double begin_s = CpuS();
        plant.Step(kRound_s);
        const double between_s = CpuS();
        for (int step = 0; step < kRound_s / kStep_s; ++step)
            mj_step(m, d);
        const double end_s = CpuS();
        real_time.push_back(kRound_s / (between_s - begin_s));
        rollers.push_back((end_s - between_s) / (between_s - begin_s));
    }
    std::printf(
        "MuJoCo, %d robots, %g ms: %.1f times real time, %.1f times as fast as ten free "
        "rollers a wheel (medians of %d)\n",
        kRobots, 1000 * kStep_s, Median(real_time), Median(rollers), kRounds);
    mj_deleteData(d);
    mj_deleteModel(m);
    mj_deleteSpec(spec);
}

// SPDX-License-Identifier: Apache-2.0
// Two and four robots drive at each other and push, in the physics of sweeps and in twin_run's.
// Truth: finer steps, in which all wheels stay on the floor; and MuJoCo's manual, which warns of
// pyramids with an impratio above 1. With those, robots ride up on each other, and jams come apart.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>

#include "plant_mujoco/mujoco_plant.h"

namespace twin
{
namespace
{

constexpr int kSteps = 600;
constexpr double kControl_s = 0.022, kStart_m = 0.28, kSpeed_mps = 0.3;
constexpr double kMostTilt_rad = 1.5 * std::numbers::pi / 180;  // a wheel 3 mm off the floor

// They start on a ring and face its centre, a little aside and askew; each curves a little.
MujocoPlant Meeting(int robots, uint64_t seed, const MujocoOptions &options)
{
    Random random(seed, 0, "meeting");
    const auto within = [&](double most) { return most * (2 * random.Uniform() - 1); };
    std::vector<Pose2> starts;
    for (int i = 0; i < robots; ++i)
    {
        const double at_rad = 2 * std::numbers::pi * i / robots + within(0.1);
        starts.push_back({kStart_m * std::cos(at_rad) + within(0.04),
                          kStart_m * std::sin(at_rad) + within(0.04),
                          at_rad + std::numbers::pi + within(0.2)});
    }
    Model model;
    model.base.drive = Drive::kTwist;
    MujocoPlant plant(FindModelFile("turbopi.xml"), std::vector<Model>(starts.size(), model),
                      starts, options);
    for (int i = 0; i < robots; ++i)
        plant.SetCommand(i, {{kSpeed_mps, 0, -0.2 + within(0.3), 0}, 0});
    return plant;
}

double Tilt(MujocoPlant &plant, int robot)
{
    const int base = mj_name2id(plant.model(), mjOBJ_BODY, NameInWorld(robot, "base").c_str());
    return std::acos(std::min(1.0, plant.data()->xmat[9 * base + 8]));
}

bool BodiesTouch(MujocoPlant &plant)
{
    const mjContact *first = plant.data()->contact, *last = first + plant.data()->ncon;
    return std::any_of(first, last, [&](const mjContact &contact) {
        return plant.model()->geom_type[contact.geom[0]] != mjGEOM_PLANE;
    });
}

class Jams : public testing::TestWithParam<MujocoOptions>
{
};

TEST_P(Jams, RobotsThatPushEachOtherStayLevel)
{
    for (const int robots : {2, 4})
    {
        double worst_rad = 0;
        int touching = 0;
        for (uint64_t seed = 1; seed <= 6; ++seed)
        {
            MujocoPlant plant = Meeting(robots, seed, GetParam());
            for (int step = 0; step < kSteps; ++step)
            {
                plant.Step(kControl_s);
                touching += BodiesTouch(plant);
                for (int i = 0; i < robots; ++i)
                    worst_rad = std::max(worst_rad, Tilt(plant, i));
            }
        }
        EXPECT_LT(worst_rad, kMostTilt_rad) << robots << " robots";
        EXPECT_GT(touching, kSteps);  // they did push
        std::printf("%d robots: tilt up to %.2f degrees\n", robots,
                    worst_rad * 180 / std::numbers::pi);
    }
}

std::string NameOfPhysics(const testing::TestParamInfo<MujocoOptions> &physics)
{
    constexpr const char *kNames[] = {"TwinRun", "Finer", "Sweeps"};
    return kNames[physics.index];
}

// What twin_run has, finer, and what sweeps have.
INSTANTIATE_TEST_SUITE_P(Physics, Jams,
                         testing::Values(MujocoOptions{}, MujocoOptions{.timestep_s = 0.001},
                                         SweepOptions(0)),
                         NameOfPhysics);

}  // namespace
}  // namespace twin

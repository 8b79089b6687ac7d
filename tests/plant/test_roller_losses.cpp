// SPDX-License-Identifier: Apache-2.0
// Tests the wheels of turbopi.xml in the MuJoCo plant, one contact and a drag each, against wheels
// built for reference: ten free rollers with bearings, in stock MuJoCo. Motors are weak here
// (stall torque over free speed of a gear motor), so that what the rollers lose shows as speed.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "plant_mujoco/mujoco_plant.h"
#include "roller_robot.h"

namespace twin
{
namespace
{

namespace fs = std::filesystem;

constexpr double kRadius_m = 0.0325, kHalfWheelbase_m = 0.059, kHalfTrack_m = 0.067;
constexpr int kSide[kMaxWheels] = {-1, 1, 1, -1}, kX[kMaxWheels] = {1, 1, -1, -1},
              kY[kMaxWheels] = {1, -1, 1, -1};
constexpr double kSettle_s = 0.4, kDrive_s = 2, kMotor_Nms = 0.008;

Wheels Rates(const Twist &twist)
{
    Wheels rates;
    for (size_t k = 0; k < kMaxWheels; ++k)
        rates[k] = (twist.vx_mps - kY[k] * kHalfTrack_m * twist.omega_radps +
                    kSide[k] * (twist.vy_mps + kX[k] * kHalfWheelbase_m * twist.omega_radps)) /
                   kRadius_m;
    return rates;
}

double Yaw(const mjtNum *q)
{
    return std::atan2(2 * (q[3] * q[6] + q[4] * q[5]), 1 - 2 * (q[5] * q[5] + q[6] * q[6]));
}

// Forward, left and heading after driving from rest.
std::array<double, 3> DriveRollers(const Twist &twist)
{
    mjSpec *spec = mj_parseXMLString(RollerRobots(1, kMotor_Nms).c_str(), nullptr, nullptr, 0);
    EXPECT_NE(spec, nullptr);
    mjModel *m = mj_compile(spec, nullptr);
    mjData *d = mj_makeData(m);
    const Wheels rates = Rates(twist);
    double turned_rad = 0;
    while (d->time < kSettle_s + kDrive_s)
    {
        for (int k = 0; k < kMaxWheels; ++k)
            d->ctrl[k] = d->time < kSettle_s ? 0 : rates[static_cast<size_t>(k)];
        const double before_rad = Yaw(d->qpos);
        mj_step(m, d);
        turned_rad += std::remainder(Yaw(d->qpos) - before_rad, 2 * M_PI);
    }
    const std::array<double, 3> went{d->qpos[0], d->qpos[1], turned_rad};
    mj_deleteData(d);
    mj_deleteModel(m);
    mj_deleteSpec(spec);
    return went;
}

// The installed robot with this test's motors.
std::string WeakRobot()
{
    const fs::path from = fs::path(FindModelFile("turbopi.xml")).parent_path();
    const fs::path to = fs::path(testing::TempDir()) / ("weak_turbopi_" + std::to_string(getpid()));
    fs::create_directories(to);
    for (const char *name : {"turbopi.xml", "turbopi_chassis.xml", "turbopi_parts.xml"})
    {
        std::ostringstream text;
        text << std::ifstream(from / name).rdbuf();
        std::string changed = text.str();
        const std::string stiff = "kv=\"0.15\"";
        if (const size_t at = changed.find(stiff); at != std::string::npos)
            changed.replace(at, stiff.size(), "kv=\"" + std::to_string(kMotor_Nms) + "\"");
        std::ofstream(to / name) << changed;
    }
    return (to / "turbopi.xml").string();
}

std::array<double, 3> DrivePlant(const Twist &twist)
{
    Model model;
    model.base.drive = Drive::kWheelSpeed;
    MujocoPlant plant(WeakRobot(), {model}, {{0, 0, 0}}, {});
    plant.Step(kSettle_s);
    plant.SetCommand(0, {Rates(twist), 0});
    for (int i = 0; i < 100; ++i)
        plant.Step(kDrive_s / 100);
    const Pose2 &pose = plant.State(0).pose;
    return {pose.x_m, pose.y_m, pose.theta_rad};
}

class RollerLosses : public testing::TestWithParam<std::tuple<size_t, Twist>>
{
};

TEST_P(RollerLosses, AreThoseOfTenFreeRollers)
{
    const auto [axis, twist] = GetParam();
    const double rollers = DriveRollers(twist)[axis], plant = DrivePlant(twist)[axis];
    std::printf("rollers %.3f, plant %.3f: %+.1f %%\n", rollers, plant,
                100 * (plant / rollers - 1));
    EXPECT_NEAR(plant, rollers, 0.03 * rollers);
}

std::string NameOfMove(const testing::TestParamInfo<RollerLosses::ParamType> &move)
{
    constexpr const char *kNames[] = {"Forward", "Left", "Turn"};
    return kNames[std::get<0>(move.param)];
}

INSTANTIATE_TEST_SUITE_P(Moves, RollerLosses,
                         testing::Values(std::tuple{size_t{0}, Twist{0.4, 0, 0}},
                                         std::tuple{size_t{1}, Twist{0, 0.4, 0}},
                                         std::tuple{size_t{2}, Twist{0, 0, 3}}),
                         NameOfMove);

}  // namespace
}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
// Tests the wheels of turbopi.xml in the MuJoCo plant, one contact and a drag each, against wheels
// built for reference: ten free rollers with bearings, in stock MuJoCo. Motors are weak here
// (stall torque over free speed of a gear motor), so that what the rollers lose shows as speed.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "plant_mujoco/mujoco_plant.h"

namespace twin
{
namespace
{

namespace fs = std::filesystem;

constexpr double kRadius_m = 0.0325, kHalfWheelbase_m = 0.059, kHalfTrack_m = 0.067;
constexpr int kSide[kWheels] = {-1, 1, 1, -1}, kX[kWheels] = {1, 1, -1, -1},
              kY[kWheels] = {1, -1, 1, -1};
constexpr double kSettle_s = 0.4, kDrive_s = 2, kMotor_Nms = 0.008;

Wheels Rates(const Twist &twist)
{
    Wheels rates;
    for (size_t k = 0; k < kWheels; ++k)
        rates[k] = (twist.vx_mps - kY[k] * kHalfTrack_m * twist.omega_radps +
                    kSide[k] * (twist.vy_mps + kX[k] * kHalfWheelbase_m * twist.omega_radps)) /
                   kRadius_m;
    return rates;
}

// A roller's barrel touches the rim all along: its profile at t off its middle is
// R - sqrt(d^2 + t^2 / 2), here an ellipsoid that fits in the middle and where the next takes over.
std::string RollerWheel(size_t k)
{
    constexpr double kRoller_m = 0.0065, kHub_m = kRadius_m - kRoller_m;
    const double t_m = kHub_m * std::tan(M_PI / 10) / std::sqrt(2);
    const double end_m = kRadius_m - std::sqrt(kHub_m * kHub_m + t_m * t_m / 2);
    const double half_m = t_m / std::sqrt(1 - std::pow(end_m / kRoller_m, 2));
    std::ostringstream text;
    text << "<body pos='" << kX[k] * kHalfWheelbase_m << " " << kY[k] * kHalfTrack_m << " "
         << kRadius_m << "'><inertial pos='0 0 0' mass='0.0227' diaginertia='7e-6 3.5e-6 7e-6'/>"
         << "<joint name='w" << k << "' axis='0 1 0' armature='1.5e-4'/>"
         << "<replicate count='10' euler='0 " << M_PI / 5 << " 0'><body pos='0 0 " << -kHub_m
         << "'><inertial pos='0 0 0' mass='0.0015' diaginertia='5e-8 5e-8 5e-8'/><joint axis='1 "
         << kSide[k] << " 0' armature='2e-7' damping='2e-6' frictionloss='3.9e-4'/>"
         << "<geom type='ellipsoid' size='" << kRoller_m << " " << kRoller_m << " " << half_m
         << "' zaxis='1 " << kSide[k] << " 0' mass='0' friction='0.8' contype='0' conaffinity='1' "
         << "solref='0.005 1'/></body></replicate></body>";
    return text.str();
}

std::string RollerRobot()
{
    std::ostringstream text;
    text << "<mujoco><compiler angle='radian'/><option timestep='0.002' integrator='implicitfast' "
            "cone='elliptic' impratio='10'/><worldbody><geom type='plane' size='9 9 1' "
            "contype='1' conaffinity='0' friction='0.8' solref='0.005 1'/><body><freejoint/>"
            "<inertial pos='0.001 0 0.051' mass='1.049' diaginertia='1.8e-3 3.3e-3 4.0e-3'/>";
    for (size_t k = 0; k < kWheels; ++k)
        text << RollerWheel(k);
    text << "</body></worldbody><actuator>";
    for (size_t k = 0; k < kWheels; ++k)
        text << "<velocity joint='w" << k << "' kv='" << kMotor_Nms << "' forcerange='-0.1 0.1'/>";
    text << "</actuator></mujoco>";
    return text.str();
}

double Yaw(const mjtNum *q)
{
    return std::atan2(2 * (q[3] * q[6] + q[4] * q[5]), 1 - 2 * (q[5] * q[5] + q[6] * q[6]));
}

// Forward, left and heading after driving from rest.
std::array<double, 3> DriveRollers(const Twist &twist)
{
    mjSpec *spec = mj_parseXMLString(RollerRobot().c_str(), nullptr, nullptr, 0);
    EXPECT_NE(spec, nullptr);
    mjModel *m = mj_compile(spec, nullptr);
    mjData *d = mj_makeData(m);
    const Wheels rates = Rates(twist);
    double turned_rad = 0;
    while (d->time < kSettle_s + kDrive_s)
    {
        for (int k = 0; k < kWheels; ++k)
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
    const fs::path to = fs::path(testing::TempDir()) / "weak_turbopi";
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

INSTANTIATE_TEST_SUITE_P(Moves, RollerLosses,
                         testing::Values(std::tuple{size_t{0}, Twist{0.4, 0, 0}},
                                         std::tuple{size_t{1}, Twist{0, 0.4, 0}},
                                         std::tuple{size_t{2}, Twist{0, 0, 3}}));

}  // namespace
}  // namespace twin

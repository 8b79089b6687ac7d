// SPDX-License-Identifier: Apache-2.0
// Robots like turbopi.xml whose wheels have ten free rollers with bearings each: stock MuJoCo, the
// reference for the plant's wheels of one contact.
#ifndef ROLLER_ROBOT_H
#define ROLLER_ROBOT_H

#include <cmath>
#include <sstream>
#include <string>

namespace twin
{

// A roller's barrel touches the rim all along: its profile at t off its middle is
// R - sqrt(d^2 + t^2 / 2), here an ellipsoid that fits in the middle and where the next takes over.
inline std::string RollerWheel(int robot, size_t k)
{
    constexpr double kRadius_m = 0.0325, kHalfWheelbase_m = 0.059, kHalfTrack_m = 0.067;
    constexpr int kSide[] = {-1, 1, 1, -1}, kX[] = {1, 1, -1, -1}, kY[] = {1, -1, 1, -1};
    constexpr double kRoller_m = 0.0065, kHub_m = kRadius_m - kRoller_m;
    const double t_m = kHub_m * std::tan(M_PI / 10) / std::sqrt(2);
    const double end_m = kRadius_m - std::sqrt(kHub_m * kHub_m + t_m * t_m / 2);
    const double half_m = t_m / std::sqrt(1 - std::pow(end_m / kRoller_m, 2));
    std::ostringstream text;
    text << "<body pos='" << kX[k] * kHalfWheelbase_m << " " << kY[k] * kHalfTrack_m << " "
         << kRadius_m << "'><inertial pos='0 0 0' mass='0.0227' diaginertia='7e-6 3.5e-6 7e-6'/>"
         << "<joint name='w" << robot << k << "' axis='0 1 0' armature='1.5e-4'/>"
         << "<replicate count='10' euler='0 " << M_PI / 5 << " 0'><body pos='0 0 " << -kHub_m
         << "'><inertial pos='0 0 0' mass='0.0015' diaginertia='5e-8 5e-8 5e-8'/><joint axis='1 "
         << kSide[k] << " 0' armature='2e-7' damping='2e-6' frictionloss='3.9e-4'/>"
         << "<geom type='ellipsoid' size='" << kRoller_m << " " << kRoller_m << " " << half_m
         << "' zaxis='1 " << kSide[k] << " 0' mass='0' friction='0.8' contype='0' conaffinity='1' "
         << "solref='0.005 1'/></body></replicate></body>";
    return text.str();
}

// MJCF of robots in rows of three, 0.3 m apart, on a floor; actuators in the order of
// robot and wheel.
inline std::string RollerRobots(int robots, double motor_Nms)
{
    std::ostringstream text, motors;
    text << "<mujoco><compiler angle='radian'/><option timestep='0.002' integrator='implicitfast' "
            "cone='elliptic' impratio='10'/><worldbody><geom type='plane' size='9 9 1' "
            "contype='1' conaffinity='0' friction='0.8' solref='0.005 1'/>";
    for (int robot = 0; robot < robots; ++robot)
    {
        text << "<body pos='" << 0.3 * (robot % 3) << " " << 0.3 * (robot / 3)
             << " 0'><freejoint/><inertial pos='0.001 0 0.051' mass='1.049' "
                "diaginertia='1.8e-3 3.3e-3 4.0e-3'/><geom type='box' size='0.095 0.08 0.055' "
                "pos='0 0 0.075' mass='0' contype='2' conaffinity='2' friction='0.3'/>";
        for (size_t k = 0; k < 4; ++k)
        {
            text << RollerWheel(robot, k);
            motors << "<velocity joint='w" << robot << k << "' kv='" << motor_Nms
                   << "' forcerange='-0.1 0.1'/>";
        }
        text << "</body>";
    }
    text << "</worldbody><actuator>" << motors.str() << "</actuator></mujoco>";
    return text.str();
}

}  // namespace twin

#endif

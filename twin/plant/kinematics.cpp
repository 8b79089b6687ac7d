// SPDX-License-Identifier: Apache-2.0
#include "plant/kinematics.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace twin
{
namespace
{

using InverseMatrix = Eigen::Matrix<double, kMaxWheels, 3>;

InverseMatrix InverseOf(const std::vector<Wheel> &wheels)
{
    InverseMatrix inverse = InverseMatrix::Zero();
    int row = 0;
    for (const Wheel &wheel : wheels)
    {
        const double g_x = wheel.grip_x(), g_y = wheel.grip_y();
        inverse.row(row++) << g_x, g_y, wheel.x_m * g_y - wheel.y_m * g_x;
    }
    return inverse;
}

}  // namespace

Kinematics::Kinematics(const Robot &robot, WheelKind kind) : Kinematics(DrivenWheels(robot, kind))
{
    steers_ = kind == WheelKind::kAckermann;
    wheelbase_m_ = 2 * robot.half_wheelbase_m;
    half_track_m_ = robot.half_track_m;
    max_steering_rad_ = robot.max_steering_rad;
    if (steers_)
        rear_m_ = robot.half_wheelbase_m;
}

Kinematics::Kinematics(const std::vector<Wheel> &wheels) : inverse_(InverseOf(wheels))
{
    // Least squares; the sideways column of a robot that cannot strafe is zero and stays so.
    Eigen::Matrix3d normal = inverse_.transpose() * inverse_;
    for (int i = 0; i < 3; ++i)
        if (normal(i, i) == 0)
            normal(i, i) = 1;
    forward_ = normal.inverse() * inverse_.transpose();
}

WheelMotion Kinematics::Inverse(const Twist &twist) const
{
    if (steers_)
    {
        const double wanted_rad =
            std::atan2(wheelbase_m_ * twist.omega_radps, std::abs(twist.vx_mps));
        return Steered(twist.vx_mps, twist.vx_mps < 0 ? -wanted_rad : wanted_rad);
    }
    WheelMotion motion;
    Eigen::Map<Eigen::Vector4d>(motion.rim_mps.data()) =
        inverse_ * Eigen::Vector3d(twist.vx_mps, twist.vy_mps, twist.omega_radps);
    return motion;
}

WheelMotion Kinematics::Steered(double vx_mps, double steering_rad) const
{
    WheelMotion motion;
    motion.steering_rad = std::clamp(steering_rad, -max_steering_rad_, max_steering_rad_);
    const double omega_radps = vx_mps * std::tan(motion.steering_rad) / wheelbase_m_;
    motion.rim_mps[0] = vx_mps - half_track_m_ * omega_radps;
    motion.rim_mps[1] = vx_mps + half_track_m_ * omega_radps;
    return motion;
}

}  // namespace twin

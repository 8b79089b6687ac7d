// SPDX-License-Identifier: Apache-2.0
#include "plant/kinematics.h"

#include <Eigen/LU>
#include <cmath>
#include <numbers>

namespace twin
{
namespace
{

using InverseMatrix = Eigen::Matrix<double, kWheels, 3>;

InverseMatrix Mecanum(double half_wheelbase_m, double half_track_m)
{
    const double lever_m = half_wheelbase_m + half_track_m;
    InverseMatrix inverse;
    inverse << 1, -1, -lever_m,  //
        1, 1, lever_m,           //
        1, 1, -lever_m,          //
        1, -1, lever_m;
    return inverse;
}

InverseMatrix Differential(double half_track_m)
{
    InverseMatrix inverse;
    inverse << 1, 0, -half_track_m,  //
        1, 0, half_track_m,          //
        1, 0, -half_track_m,         //
        1, 0, half_track_m;
    return inverse;
}

InverseMatrix Omni3(double lever_m)
{
    InverseMatrix inverse = InverseMatrix::Zero();
    for (int k = 0; k < 3; ++k)
    {
        const double at_rad = std::numbers::pi * (1 + 2 * k) / 3;
        inverse.row(k) << -std::sin(at_rad), std::cos(at_rad), lever_m;
    }
    return inverse;
}

InverseMatrix InverseOf(const Robot &robot, WheelKind kind)
{
    switch (kind)
    {
        case WheelKind::kDifferential: return Differential(robot.half_track_m);
        case WheelKind::kOmni3: return Omni3(robot.half_track_m);
        case WheelKind::kMecanum:
        case WheelKind::kNone: break;
    }
    return Mecanum(robot.half_wheelbase_m, robot.half_track_m);
}

}  // namespace

Kinematics::Kinematics(const Robot &robot, WheelKind kind) : inverse_(InverseOf(robot, kind))
{
    // Least squares; the sideways column of a differential drive is zero and stays so.
    Eigen::Matrix3d normal = inverse_.transpose() * inverse_;
    for (int i = 0; i < 3; ++i)
        if (normal(i, i) == 0)
            normal(i, i) = 1;
    forward_ = normal.inverse() * inverse_.transpose();
}

Twist Kinematics::Forward(const Wheels &rim_mps) const
{
    const Eigen::Vector3d v = forward_ * Eigen::Map<const Eigen::Vector4d>(rim_mps.data());
    return {v.x(), v.y(), v.z()};
}

Wheels Kinematics::Inverse(const Twist &twist) const
{
    Wheels rim_mps;
    Eigen::Map<Eigen::Vector4d>(rim_mps.data()) =
        inverse_ * Eigen::Vector3d(twist.vx_mps, twist.vy_mps, twist.omega_radps);
    return rim_mps;
}

}  // namespace twin

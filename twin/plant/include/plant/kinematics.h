// SPDX-License-Identifier: Apache-2.0
// Rim speeds of the wheels to body velocity and back.
#ifndef PLANT_KINEMATICS_H
#define PLANT_KINEMATICS_H

#include <Eigen/Core>

#include "model_file/model.h"

namespace twin
{

struct Twist
{
    double vx_mps = 0, vy_mps = 0, omega_radps = 0;  // forward, left, counter-clockwise
};

// Mecanum: rim_k = vx + s_k vy + (-y_k + s_k x_k) omega, s = -,+,+,-; forward by least squares.
// (Muir and Neuman 1987, "Kinematic modeling for feedback control of an omnidirectional wheeled
// robot".) Differential: left and right pairs, no sideways motion. Omni3: three wheels at 60, 180
// and 300 degrees, rolling counter-clockwise; the fourth rim is unused. None: the ideal mecanum
// equations.
class Kinematics
{
public:
    Kinematics(const Robot &robot, WheelKind kind);
    Twist Forward(const Wheels &rim_mps) const;
    Wheels Inverse(const Twist &twist) const;

private:
    Eigen::Matrix<double, 3, kWheels> forward_;
    Eigen::Matrix<double, kWheels, 3> inverse_;
};

}  // namespace twin

#endif

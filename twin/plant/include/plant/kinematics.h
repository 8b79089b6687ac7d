// SPDX-License-Identifier: Apache-2.0
// Wheel motion to body velocity and back, for every layout of wheels.
#ifndef PLANT_KINEMATICS_H
#define PLANT_KINEMATICS_H

#include <Eigen/Core>
#include <cmath>

#include "model_file/model.h"

namespace twin
{

struct Twist
{
    double vx_mps = 0, vy_mps = 0, omega_radps = 0;  // forward, left, counter-clockwise
};

struct WheelMotion
{
    Wheels rim_mps{};
    double steering_rad = 0;  // Ackermann: of the middle of the front axle, left positive
};

// A wheel at (x, y) that rolls along t and grips along g turns with the part of its contact point's
// velocity along g: rim = g . (vx - y omega, vy + x omega) / (g . t); forward by least squares.
// (Muir and Neuman 1987, "Kinematic modeling for feedback control of an omnidirectional wheeled
// robot".) Differential: no sideways motion. Ackermann: the middle of the rear axle moves along the
// robot, and omega = vx tan(steering) / wheelbase (Rajamani 2012, Vehicle Dynamics and Control,
// sec. 2.2).
class Kinematics
{
public:
    Kinematics(const Robot &robot, WheelKind kind);
    // Of wheels at these places, none of them steered.
    explicit Kinematics(const std::vector<Wheel> &wheels);
    Twist Forward(const WheelMotion &motion) const
    {
        const Eigen::Vector3d v =
            forward_ * Eigen::Map<const Eigen::Vector4d>(motion.rim_mps.data());
        if (steers_)
            return {v.x(), 0, v.x() * std::tan(motion.steering_rad) / wheelbase_m_};
        return {v.x(), v.y(), v.z()};
    }
    // The motion nearest to `twist` that the wheels can make. A steered robot cannot turn on the
    // spot; its steering stays within its limit.
    WheelMotion Inverse(const Twist &twist) const;
    // Of a robot that is steered at this speed and angle.
    WheelMotion Steered(double vx_mps, double steering_rad) const;
    bool steers() const { return steers_; }
    bool operator==(const Kinematics &) const = default;
    // Sideways speed at the robot's middle that comes from turning about the rear axle.
    double SidewaysOfTurning(double omega_radps) const { return rear_m_ * omega_radps; }

private:
    bool steers_ = false;
    double rear_m_ = 0, wheelbase_m_ = 0, half_track_m_ = 0, max_steering_rad_ = 0;
    Eigen::Matrix<double, 3, kMaxWheels> forward_;
    Eigen::Matrix<double, kMaxWheels, 3> inverse_;
};

}  // namespace twin

#endif

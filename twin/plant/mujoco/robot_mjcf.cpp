// SPDX-License-Identifier: Apache-2.0
#include "robot_mjcf.h"

#include <sstream>

#include "mecanum_collider.h"

namespace twin
{
namespace
{

constexpr double kWheelShare = 0.03;  // of the robot's mass, each
constexpr double kHullHalfHeight_m = 0.04;
// A TurboPi's: mass, wheel radius, stall torque, and velocity gain of its four motors.
constexpr double kTurboPi_kg = 1.2, kTurboPiRadius_m = 0.0325;
constexpr double kStall_Nm = 0.1, kGain_Nms = 0.15, kArmature_kgm2 = 1.5e-4;

bool OnOneAxle(const Model &model)
{
    return model.base.wheels == WheelKind::kDifferential &&
           (model.robot.half_wheelbase_m == 0 || !model.States("robot.half_wheelbase_m"));
}

void WriteHull(std::ostream &out, const Model &model, double mass_kg)
{
    const double r_m = model.robot.body_radius_m, h_m = kHullHalfHeight_m;
    const double z_m = model.robot.wheel_radius_m + h_m;
    const double flat_kgm2 = mass_kg * (3 * r_m * r_m + 4 * h_m * h_m) / 12;
    out << "<freejoint name='free'/><inertial pos='0 0 " << model.robot.wheel_radius_m << "' mass='"
        << mass_kg << "' diaginertia='" << flat_kgm2 << ' ' << flat_kgm2 << ' '
        << mass_kg * r_m * r_m / 2 << "'/>"
        << "<geom name='hull' type='cylinder' mass='0' contype='2' conaffinity='3' friction='0.3' "
           "size='"
        << r_m << ' ' << h_m << "' pos='0 0 " << z_m << "'/>"
        << "<site name='marker' size='0.004'/>";
}

// Under the hull, ahead and behind; they slide.
void WriteSkids(std::ostream &out, const Model &model)
{
    const double r_m = model.robot.wheel_radius_m / 2;
    for (const double x_m : {0.7 * model.robot.body_radius_m, -0.7 * model.robot.body_radius_m})
        out << "<geom type='sphere' mass='0' contype='0' conaffinity='1' condim='1' priority='1' "
               "friction='0' size='"
            << r_m << "' pos='" << x_m << " 0 " << r_m << "'/>";
}

void WriteWheel(std::ostream &out, const Model &model, const Wheel &wheel, double mass_kg)
{
    const double r_m = model.robot.wheel_radius_m, half_width_m = 0.4 * r_m;
    const double scale =
        model.robot.mass_kg / kTurboPi_kg * r_m * r_m / (kTurboPiRadius_m * kTurboPiRadius_m);
    const double spin_kgm2 = mass_kg * r_m * r_m / 2;
    const double flat_kgm2 = mass_kg * (3 * r_m * r_m + 4 * half_width_m * half_width_m) / 12;
    // Its frame has y along the axle, to the left of where it rolls.
    out << "<body name='" << wheel.name << "' pos='" << (OnOneAxle(model) ? 0 : wheel.x_m) << ' '
        << wheel.y_m << ' ' << r_m << "' xyaxes='" << wheel.roll_x << ' ' << wheel.roll_y << " 0 "
        << -wheel.roll_y << ' ' << wheel.roll_x << " 0'>"
        << "<inertial pos='0 0 0' mass='" << mass_kg << "' diaginertia='" << flat_kgm2 << ' '
        << spin_kgm2 << ' ' << flat_kgm2 << "'/>"
        << "<joint name='" << wheel.name << "' axis='0 1 0' armature='" << kArmature_kgm2 * scale
        << "'/>"
        << "<geom name='" << wheel.name << "' type='cylinder' mass='0' zaxis='0 1 0' contype='0' "
        << "conaffinity='1' friction='0.8' solref='0.005 1' size='" << r_m << ' ' << half_width_m
        << "' user='" << RollerCode(wheel.tread) << "'/></body>";
}

}  // namespace

double RollerCode(Tread tread)
{
    switch (tread)
    {
        case Tread::kPlain: return 0;
        case Tread::kRollersLeft: return 1;
        case Tread::kRollersRight: return -1;
        case Tread::kRollersAcross: return kRollersAcrossCode;
    }
    return 0;
}

std::string RobotMjcf(const Model &model)
{
    const std::vector<Wheel> wheels = model.MakeWheels();
    const double count = static_cast<double>(wheels.size());
    const double r_m = model.robot.wheel_radius_m, size = r_m / kTurboPiRadius_m;
    const double strength = model.robot.mass_kg / kTurboPi_kg * kMaxWheels / count;
    const double wheel_kg = kWheelShare * model.robot.mass_kg;
    std::ostringstream out;
    out.precision(17);
    out << "<mujoco model='robot'><compiler angle='radian' autolimits='true'/>"
        << "<size nuser_geom='1'/><worldbody><body name='base'>";
    WriteHull(out, model, model.robot.mass_kg - count * wheel_kg);
    if (OnOneAxle(model))
        WriteSkids(out, model);
    for (const Wheel &wheel : wheels)
        WriteWheel(out, model, wheel, wheel_kg);
    out << "</body></worldbody><actuator>";
    for (const Wheel &wheel : wheels)
        out << "<velocity name='" << wheel.name << "' joint='" << wheel.name << "' kv='"
            << kGain_Nms * strength * size * size << "' forcerange='"
            << -kStall_Nm * strength * size << ' ' << kStall_Nm * strength * size << "'/>";
    out << "</actuator></mujoco>";
    return out.str();
}

}  // namespace twin

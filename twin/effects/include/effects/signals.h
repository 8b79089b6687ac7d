// SPDX-License-Identifier: Apache-2.0
// What the effects of each stage read (const) and change. Angles and turn rates are positive
// counter-clockwise.
#ifndef EFFECTS_SIGNALS_H
#define EFFECTS_SIGNALS_H

#include <array>
#include <cmath>
#include <limits>

#include "effects/direction.h"

namespace twin
{

constexpr int kMaxWheels = 4;
// One number per driven wheel, in the order of the robot's wheels; the rest is 0.
using Wheels = std::array<double, kMaxWheels>;
constexpr double kNoLimit = std::numeric_limits<double>::infinity();

// What effects may ask of the robot. By default a TurboPi's wheels: front-left, front-right,
// rear-left, rear-right.
struct RobotFacts
{
    int wheels = kMaxWheels;     // driven
    Wheels left{1, -1, 1, -1};   // 1: the wheel is left of the middle, -1: right, 0: neither
    Wheels front{1, 1, -1, -1};  // the same for front and rear
    // Rim speeds that turn the body on the spot, of length 1; 0 where wheels alone cannot.
    Wheels spin{-0.5, 0.5, -0.5, 0.5};
    double wheel_radius_m = 0;     // of the base model
    double battery_nominal_V = 0;  // pack voltage at which the base model's speeds hold

    bool operator==(const RobotFacts &) const = default;
};

// The command, before it becomes a wheel speed.
struct DutySignals
{
    const RobotFacts &robot;
    const double t_s;        // start of the step, robot's clock
    const double battery_V;  // pack voltage now; 0: not measured
    // Length of the step. An effect whose output changes within the step shortens it to end there;
    // the plant then goes through the stages of duty, wheel and rolling again for the rest.
    double dt_s;
    Wheels duty;  // on its way to the wheels; duty drive: -1..1; other drives: their command
};

// The speed each wheel tends to, and how fast it gets there.
struct WheelSignals
{
    const RobotFacts &robot;
    const double t_s, dt_s, battery_V;
    const Wheels &duty;       // as the duty stage left it
    const Wheels &rim_mps;    // rim speed at the start of the step
    const Wheels &wheel_rad;  // angle at the start and what was turned since
    Wheels target_mps{};      // rim speed that the wheel tends to
    Wheels tau_s{};           // time constant with which it gets there
    Wheels max_decel_mps2{kNoLimit, kNoLimit, kNoLimit, kNoLimit};  // limit on slowing down
    double turn_extra_s = 0;  // time constant of turning the body together, less tau_s

    // True while a wheel rolls freely, slowed down by friction alone: its motor's lag does not act
    // then, whichever of the two effects stands first in the model.
    bool IsCoasting(int wheel) const { return std::isfinite(max_decel_mps2[wheel]); }
};

// The step that the wheels have made, and what becomes of it on the floor.
struct RollSignals
{
    const RobotFacts &robot;
    const double t_s, dt_s;
    const Wheels &duty;
    const Wheels &mean_mps;           // rim speed, mean over the step
    const Wheels &end_mps;            // at its end
    const Wheels &wheel_rad;          // angle at the start of the step
    Wheels radius_ratio{1, 1, 1, 1};  // way over the floor per way of the rim
};

// The body's velocity over the floor.
struct GroundSignals
{
    const RobotFacts &robot;
    const double t_s, dt_s;
    const bool moves;                    // some wheel turns
    const double x_m, y_m, theta_rad;    // pose in W at the start of the step
    const Direction ahead;               // along theta_rad
    double vx_mps, vy_mps, omega_radps;  // body frame

    // Where the robot heads after `after_s` of the step.
    Direction AheadAfter(double after_s) const
    {
        return ahead.Turned(Direction::Of(omega_radps * after_s));
    }
};

// What motion capture reports.
struct ObservedPose
{
    double x_m, y_m, theta_rad;
    double t_s;  // time stamp, capture's clock
};

// What a robot's camera sees, and how its bit errs. One robot's numbers do not change while it
// runs: its effects set them once.
struct DetectionModel
{
    double range_m = 0;          // view: farthest target seen
    double softness_m = 0;       // view: scale of a logistic edge at range_m; 0: sharp
    double cone_rad = 0;         // view: full opening angle
    double pan_rad = 0;          // view: the cone's axis, left of the heading
    double target_radius_m = 0;  // view: 0: only the other robot's centre is seen
    double hide_radius_m = 0;    // view: of bodies that hide what is behind them; 0: none do
    double miss_rate = 0;        // decide: share of frames that miss what is in view
    double false_rate = 0;       // decide: share of frames that see what is not there
    double age_s = 0;            // decide: exposure before the frame's time stamp
    double delay_s = 0;          // decide: time stamp to controller
    double vote_frames = 1;      // decide: seen if more than half of so many frames show it
};

// What a robot's body does on contact.
struct Body
{
    double radius_m = 0;  // 0: nothing touches
    double friction = 0;  // Coulomb's coefficient against another body
};

}  // namespace twin

#endif

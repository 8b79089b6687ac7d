// SPDX-License-Identifier: Apache-2.0
// Plays commands to one planar robot, for the tests of effects and of the plant.
#ifndef TESTS_EFFECTS_DRIVE_H
#define TESTS_EFFECTS_DRIVE_H

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "plant/planar_plant.h"

namespace twin::test
{

// The signals of all stages, to be given to an effect of any.
struct Signals
{
    double t_s = 0, dt_s = 0, battery_V = 0;
    RobotFacts robot;
    Wheels duty{}, rim_mps{}, target_mps{}, tau_s{};
    Wheels max_decel_mps2{kNoLimit, kNoLimit, kNoLimit, kNoLimit};
    Wheels mean_mps{}, wheel_rad{}, radius_ratio{1, 1, 1, 1};
    bool moves = false;
    double x_m = 0, y_m = 0, theta_rad = 0, vx_mps = 0, vy_mps = 0, omega_radps = 0;
    double observed_t_s = 0;
};

// Those of the ground among them, which go on reading the facts of the robot there.
inline GroundSignals GroundOf(const Signals &s)
{
    return {s.robot,  s.t_s,    s.dt_s,       s.moves,
            s.x_m,    s.y_m,    s.theta_rad,  Direction::Of(s.theta_rad),
            s.vx_mps, s.vy_mps, s.omega_radps};
}

// One effect by itself.
class Alone
{
public:
    explicit Alone(BoundEffect effect) : effect_(std::move(effect)) {}

    int StateSize() const { return effect_.StateSize(); }
    void Set(DetectionModel &detection) const { effect_.Set(detection); }
    void Set(Body &body) const { effect_.Set(body); }

    // What it does to the signals of its stage; of others nothing.
    void Step(Signals &s, double *state) const
    {
        const Numbers numbers = effect_.numbers();
        if (const auto *on = std::get_if<OnDuty>(&effect_.act()))
        {
            DutySignals duty{s.robot, s.t_s, s.battery_V, s.dt_s, s.duty};
            on->step(duty, numbers, state);
            s.dt_s = duty.dt_s;
            s.duty = duty.duty;
        }
        if (const auto *on = std::get_if<OnWheels>(&effect_.act()))
        {
            WheelSignals wheels{s.robot, s.t_s,           s.dt_s,      s.battery_V,
                                s.duty,  s.rim_mps,       s.wheel_rad, s.target_mps,
                                s.tau_s, s.max_decel_mps2};
            on->step(wheels, numbers, state);
            s.target_mps = wheels.target_mps;
            s.tau_s = wheels.tau_s;
            s.max_decel_mps2 = wheels.max_decel_mps2;
        }
        if (const auto *on = std::get_if<OnRolling>(&effect_.act()))
        {
            RollSignals roll{s.robot,    s.t_s,     s.dt_s,      s.duty,
                             s.mean_mps, s.rim_mps, s.wheel_rad, s.radius_ratio};
            on->step(roll, numbers, state);
            s.radius_ratio = roll.radius_ratio;
        }
        if (const auto *on = std::get_if<OnGround>(&effect_.act()))
        {
            GroundSignals ground = GroundOf(s);
            on->step(ground, numbers, state);
            s.vx_mps = ground.vx_mps;
            s.vy_mps = ground.vy_mps;
            s.omega_radps = ground.omega_radps;
        }
        Observe(s, [&](const OnObservation &on, ObservedPose &p) { on.observe(p, numbers); });
    }

    void Invert(Signals &s) const
    {
        Observe(s,
                [&](const OnObservation &on, ObservedPose &p) { on.invert(p, effect_.numbers()); });
    }

private:
    template <class Do>
    void Observe(Signals &s, Do change) const
    {
        const auto *on = std::get_if<OnObservation>(&effect_.act());
        if (!on)
            return;
        ObservedPose pose{s.x_m, s.y_m, s.theta_rad, s.observed_t_s};
        change(*on, pose);
        s.x_m = pose.x_m;
        s.y_m = pose.y_m;
        s.theta_rad = pose.theta_rad;
        s.observed_t_s = pose.t_s;
    }

    BoundEffect effect_;
};

// Of the default robot.
inline std::vector<Parameter> ParametersOf(const EffectSpec &spec)
{
    return ParametersFor(spec, Model().MakeWheels());
}

inline Alone MakeAlone(const std::string &effect, const std::vector<double> &values)
{
    return Alone(BoundEffect(*FindEffect(effect), values));
}

constexpr Wheels kForward{1, 1, 1, 1}, kBack{-1, -1, -1, -1}, kStop{};
constexpr Wheels kTurnLeft{-1, 1, -1, 1}, kStrafeLeft{-1, 1, 1, -1};
constexpr double kFull_mps = 0.36;          // rim speed of the default model at full duty
constexpr double kLever_m = 0.059 + 0.067;  // its half wheelbase plus half track

// `model` with one more effect, driven as the effect asks; parameters without a value stay neutral.
inline Model With(const std::string &effect, const std::vector<double> &values, Model model = {})
{
    if (!(FindEffect(effect)->card.drives & static_cast<unsigned>(model.base.drive)))
        model.base.drive = Drive::kTwist;
    model.AddEffect(effect);
    for (size_t i = 0; i < values.size(); ++i)
        model.effects.back().parameters[i].value = values[i];
    return model;
}

inline Model Lagging(double motor_lag_s)
{
    Model model;
    model.base.motor_lag_s = motor_lag_s;
    return model;
}

// A wheel's duty after an effect of the duty stage that has no memory.
inline double DutyAfter(const std::string &effect, const std::vector<double> &values, double duty)
{
    Signals s;
    s.duty.fill(duty);
    MakeAlone(effect, values).Step(s, nullptr);
    return s.duty[0];
}

// One robot; `state` may be copied out and put back.
class Player
{
public:
    Player(const Model &model, double dt_s, const Pose2 &start = {}, Random *random = nullptr)
        : chain(model), state(chain.Start(start)), dt_s_(dt_s), random_(random)
    {
    }

    // Holds a command; `duration_s` is a whole number of steps.
    void Play(const Wheels &value, double duration_s, double battery_V = 0)
    {
        for (long steps = std::lround(duration_s / dt_s_); steps > 0; --steps, ++step_)
            PlanarStep(chain, {value, battery_V}, static_cast<double>(step_) * dt_s_, dt_s_, state,
                       random_);
    }

    // The pose that motion capture would report.
    Pose2 Seen() const
    {
        Pose2 pose = state.pose;
        double t_s = 0;
        chain.Observe(pose, t_s);
        return pose;
    }

    DriveChain chain;
    RobotState state;

private:
    double dt_s_;
    Random *random_;
    long step_ = 0;
};

inline Wheels Scaled(Wheels duty, double factor)
{
    for (double &u : duty)
        u *= factor;
    return duty;
}

// Several seconds of all kinds of motion, with stops.
inline void PlayMedley(Player &player)
{
    const Wheels legs[] = {kForward,
                           kStop,
                           Scaled(kTurnLeft, 0.6),
                           Scaled(kBack, 0.5),
                           {0.4, 0.9, 0.4, 0.9},
                           Scaled(kStrafeLeft, -0.7),
                           {0.1, 0.9, 0.7, 0.3},
                           kStop,
                           {-0.8, -0.3, -0.8, -0.3},
                           kStop};
    for (const Wheels &leg : legs)
        player.Play(leg, 0.6, 7.0);
}

}  // namespace twin::test

#endif

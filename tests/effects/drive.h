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

constexpr Wheels kForward{1, 1, 1, 1}, kBack{-1, -1, -1, -1}, kStop{};
constexpr Wheels kTurnLeft{-1, 1, -1, 1}, kStrafeLeft{-1, 1, 1, -1};
constexpr double kFull_mps = 0.36;          // rim speed of the default model at full duty
constexpr double kLever_m = 0.059 + 0.067;  // its half wheelbase plus half track

// `model` with one more effect; parameters without a value stay neutral.
inline Model With(const std::string &effect, const std::vector<double> &values, Model model = {})
{
    model.AddEffect(effect);
    std::copy(values.begin(), values.end(), model.effects.back().values.begin());
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
    FindEffect(effect)->make(values)->Step(s, nullptr);
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

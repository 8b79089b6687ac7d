// SPDX-License-Identifier: Apache-2.0
// One robot's path from command to velocity over the floor: the stages of duty, wheel, rolling and
// ground, shared by both plants.
#ifndef PLANT_DRIVE_CHAIN_H
#define PLANT_DRIVE_CHAIN_H

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include "effects/together.h"
#include "model_file/model.h"
#include "plant/kinematics.h"
#include "plant/plant.h"
#include "plant/random.h"

namespace twin
{

// A first-order approach to rest never ends: below this rim speed a wheel counts as standing.
constexpr double kStandstill_mps = 1e-3;

// What the wheels alone make of the body, before gains and effects of the floor.
struct Rolling
{
    Twist twist;
    bool moves = false;  // some wheel turns
};

// What a robot is told from `t_s` on for `dt_s`.
struct DriveStep
{
    Command command;
    double t_s, dt_s;
};

class DriveChain
{
public:
    // `model` is the model of this one robot (Model::ForRobot).
    explicit DriveChain(const Model &model);

    RobotState Start(const Pose2 &pose) const;
    // Up to rolling: advances the wheels' speed and angle and the steering by `dt_s`; returns the
    // mean motion with which they roll meanwhile.
    WheelMotion DriveWheels(const Command &command, double t_s, double dt_s,
                            RobotState &state) const;
    // The wheels from rest through these steps; `decays`: of each step with LagS(), where it is
    // prompt.
    std::vector<Rolling> RollThrough(std::span<const DriveStep> steps,
                                     std::span<const Decay> decays) const;
    // Time constant of the wheels, before any effect.
    double LagS() const { return base_.motor_lag_s; }
    // Ground stage: the body velocity that this motion gives, gains, effects and, if `random` is
    // not null, drive noise included. Stores it in `state`.
    Twist BodyTwist(const WheelMotion &motion, double t_s, double dt_s, RobotState &state,
                    Random *random) const;
    // The same in two parts. The first depends on nothing but the motion, and is written where it
    // stays; the second is told where the robot heads.
    void RollBy(const WheelMotion &motion, Rolling &rolling) const
    {
        rolling.twist = kinematics_.Forward(motion);
        rolling.moves = std::ranges::any_of(motion.rim_mps,
                                            [](double v) { return std::abs(v) > kStandstill_mps; });
    }
    Twist OnFloor(const Rolling &rolling, const Direction &ahead, double t_s, double dt_s,
                  RobotState &state, Random *random) const;
    // With the base's gains: the velocity that effects of the ground find.
    Twist Geared(const Rolling &rolling) const
    {
        Twist twist = rolling.twist;
        twist.vx_mps *= base_.forward_gain * theta_a1_;
        twist.vy_mps *= base_.sideways_gain * theta_a1_;
        twist.omega_radps *= base_.yaw_gain * theta_a2_;
        if (kinematics_.steers())
            twist.vy_mps += kinematics_.SidewaysOfTurning(twist.omega_radps);
        return twist;
    }
    // The second without noise, of the first `count` of several robots whose wheels move alike.
    // memory(i) is what effects remember of robot i.
    template <class Memory>
    EachGround OnFloor(const Rolling &rolling, const EachPose &pose, size_t count, double t_s,
                       double dt_s, Memory memory) const
    {
        EachGround robots{robot_, t_s, dt_s, rolling.moves, pose, count};
        const Twist geared = Geared(rolling);
        robots.vx_mps.fill(geared.vx_mps);
        robots.vy_mps.fill(geared.vy_mps);
        robots.omega_radps.fill(geared.omega_radps);
        for (const Bound<OnGround> &bound : ground_)
        {
            if (bound.act.steps)
            {
                bound.act.steps(robots, bound.numbers);
                continue;
            }
            for (size_t i = 0; i < count; ++i)
            {
                GroundSignals alone = robots.At(i);
                bound.act.step(alone, bound.numbers, memory(i) + bound.state_offset);
                robots.Take(i, alone);
            }
        }
        return robots;
    }

    // Observe stage: the pose and time stamp that motion capture reports, and the way back.
    void Observe(Pose2 &pose, double &t_s) const;
    void Invert(Pose2 &pose, double &t_s) const;

    // What its wheels are asked for depends on its command alone.
    bool IsPrompt() const { return prompt_; }
    // Its wheels roll as the other's do, whatever the floor makes of it.
    bool DrivesAs(const DriveChain &other) const;
    // It is seen as the other is.
    bool IsSeenAs(const DriveChain &other) const;

    const Kinematics &kinematics() const { return kinematics_; }
    int WheelCount() const { return robot_.wheels; }
    // No effect of the ground reads where the robot is or heads, nor remembers anything: its
    // velocity in the body frame depends on its commands alone.
    bool IsHomogeneous() const { return homogeneous_; }
    // Some formula has had no finite value so far.
    bool IsSilent() const;
    // No effect on the ground at all.
    bool IsBare() const { return ground_.empty(); }
    // Some effect on the ground has a state.
    bool RemembersOnGround() const { return remembers_on_ground_; }

private:
    template <class On>
    struct Bound
    {
        On act;
        Numbers numbers;
        int state_offset;
        Turn turn;
    };
    void Bind(const EffectInstance &instance);
    template <class On, class S>
    static void Run(const std::vector<Bound<On>> &stage, S &signals, RobotState &state);
    template <class... On>
    bool HasSame(const DriveChain &other) const;
    WheelMotion Target(const Wheels &command) const;
    void Ask(const Command &command, RobotState &state) const;
    WheelMotion DrivePart(const DutySignals &duty, RobotState &state) const;
    Wheels TurnWheels(const DutySignals &duty, RobotState &state) const;
    WheelMotion Approached(const Decay &decay, double t_s, RobotState &state) const;
    WheelMotion Turned(double t_s, double dt_s, const Wheels &mean_mps, RobotState &state) const;
    void Disturb(Twist &twist, double dt_s, RobotState &state, Random &random) const;

    Base base_;
    Noise noise_;
    Clock clock_;
    Frame frame_;
    double theta_a1_, theta_a2_;
    RobotFacts robot_;
    Kinematics kinematics_;
    std::vector<std::unique_ptr<const BoundEffect>> effects_;  // the stages point into them
    std::vector<Bound<OnDuty>> duty_;
    std::vector<Bound<OnWheels>> wheel_;
    std::vector<Bound<OnRolling>> rolling_;
    std::vector<Bound<OnGround>> ground_;
    std::vector<Bound<OnObservation>> observe_;
    int state_size_ = 0;
    bool homogeneous_ = true;
    bool prompt_ = true;
    bool remembers_on_ground_ = false;
};

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// One robot's path from command to velocity over the floor: duty, wheel and ground stages, shared
// by both plants.
#ifndef PLANT_DRIVE_CHAIN_H
#define PLANT_DRIVE_CHAIN_H

#include <memory>
#include <vector>

#include "model_file/model.h"
#include "plant/kinematics.h"
#include "plant/plant.h"
#include "plant/random.h"

namespace twin
{

class DriveChain
{
public:
    // `model` is the model of this one robot (Model::ForRobot).
    explicit DriveChain(const Model &model);

    RobotState Start(const Pose2 &pose) const;
    // Duty and wheel stages: advances the wheels' speed and angle by `dt_s`; returns the mean
    // speeds at which they roll meanwhile.
    Wheels DriveWheels(const Command &command, double t_s, double dt_s, RobotState &state) const;
    // Ground stage: the body velocity that these rim speeds give, gains, effects and, if `random`
    // is not null, drive noise included. Stores it in `state`.
    Twist BodyTwist(const Wheels &rim_mps, double t_s, double dt_s, RobotState &state,
                    Random *random) const;

    // Observe stage: the pose and time stamp that motion capture reports, and the way back.
    void Observe(Pose2 &pose, double &t_s) const;
    void Invert(Pose2 &pose, double &t_s) const;

    const Kinematics &kinematics() const { return kinematics_; }

private:
    struct Bound
    {
        std::unique_ptr<Effect> effect;
        int state_offset;
    };
    void Run(const std::vector<Bound> &stage, Signals &signals, RobotState &state) const;
    Wheels Target(const Wheels &command) const;
    void ActOnGround(Twist &twist, const Wheels &rim_mps, bool moves, double t_s, double dt_s,
                     RobotState &state) const;
    void Disturb(Twist &twist, double dt_s, RobotState &state, Random &random) const;

    Base base_;
    Noise noise_;
    Clock clock_;
    double theta_a1_, theta_a2_, battery_nominal_V_, wheel_radius_m_;
    Kinematics kinematics_;
    std::vector<Bound> duty_, wheel_, ground_, observe_;
    int state_size_ = 0;
};

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// The fast plant: velocities in the plane, no forces.
#ifndef PLANT_PLANAR_PLANT_H
#define PLANT_PLANAR_PLANT_H

#include <vector>

#include "plant/drive_chain.h"

namespace twin
{

// The pose after `dt_s` at constant velocity: the exact arc.
Pose2 AlongArc(const Pose2 &from, const Twist &twist, double dt_s);

// The same arcs one after the other. The heading is a vector that turns, which is
// quicker than its cosine and sine at every step.
class Course
{
public:
    explicit Course(const Pose2 &start) : pose_(start), ahead_(Direction::Of(start.theta_rad)) {}

    void Follow(const Twist &v, double dt_s)
    {
        const double half_rad = v.omega_radps * dt_s / 2;
        const double over = SinOver(half_rad), chord_s = dt_s * over;
        const Direction turn{Cos(half_rad), half_rad * over}, middle = ahead_.Turned(turn);
        pose_.x_m += chord_s * (middle.c * v.vx_mps - middle.s * v.vy_mps);
        pose_.y_m += chord_s * (middle.s * v.vx_mps + middle.c * v.vy_mps);
        pose_.theta_rad += 2 * half_rad;
        ahead_ = middle.Turned(turn);
    }

    const Pose2 &pose() const { return pose_; }
    const Direction &ahead() const { return ahead_; }

private:
    Pose2 pose_;
    Direction ahead_;
};

// Moves one robot by `dt_s`: wheels, ground velocity, then the exact arc at constant velocity.
void PlanarStep(const DriveChain &chain, const Command &command, double t_s, double dt_s,
                RobotState &state, Random *random);

// Many robots that do not touch: bodies may be pushed apart by the swarm that owns the plant.
class PlanarPlant : public Plant
{
public:
    // One model and start pose per robot (Model::ForRobot).
    PlanarPlant(const std::vector<Model> &models, const std::vector<Pose2> &starts, uint64_t seed);

    int Size() const override { return static_cast<int>(robots_.size()); }
    void SetCommand(int robot, const Command &command) override;
    void Step(double dt_s) override;
    const RobotState &State(int robot) const override;
    bool IsSilent(int robot) const override
    {
        return robots_[static_cast<size_t>(robot)].chain.IsSilent();
    }
    double TimeS() const override { return t_s_; }

    // Puts a robot elsewhere: bodies that overlap are pushed apart.
    void Move(int robot, const Pose2 &pose);

private:
    struct Member
    {
        DriveChain chain;
        Random random;
        RobotState state;
        Command command;
    };
    std::vector<Member> robots_;
    double t_s_ = 0;
};

}  // namespace twin

#endif

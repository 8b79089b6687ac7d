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
    explicit Course(const Pose2 &start) : Course(start, Direction::Of(start.theta_rad)) {}
    Course(const Pose2 &start, const Direction &ahead) : pose_(start), ahead_(ahead) {}

    void Follow(const Twist &v, double dt_s)
    {
        const double half_rad = v.omega_radps * dt_s / 2;
        Follow(v, dt_s, half_rad, Cos(half_rad), SinOver(half_rad));
    }

    // The same with the cosine of half the turn, and its sine over it.
    void Follow(const Twist &v, double dt_s, double half_rad, double cos, double sin_over)
    {
        const double chord_s = dt_s * sin_over;
        const Direction turn{cos, half_rad * sin_over}, middle = ahead_.Turned(turn);
        pose_.x_m += chord_s * (middle.c * v.vx_mps - middle.s * v.vy_mps);
        pose_.y_m += chord_s * (middle.s * v.vx_mps + middle.c * v.vy_mps);
        pose_.theta_rad += 2 * half_rad;
        ahead_ = ahead_.Turned(turn.Turned(turn));  // waits for no more than the last heading
    }

    const Pose2 &pose() const { return pose_; }
    const Direction &ahead() const { return ahead_; }

private:
    Pose2 pose_;
    Direction ahead_;
};

// Courses of a few robots that are moved together.
class Courses
{
public:
    const EachPose &poses() const { return poses_; }

    Course At(size_t i) const
    {
        return {{poses_.x_m[i], poses_.y_m[i], poses_.theta_rad[i]}, {poses_.c[i], poses_.s[i]}};
    }

    void Take(size_t i, const Course &course)
    {
        poses_.x_m[i] = course.pose().x_m;
        poses_.y_m[i] = course.pose().y_m;
        poses_.theta_rad[i] = course.pose().theta_rad;
        poses_.c[i] = course.ahead().c;
        poses_.s[i] = course.ahead().s;
    }

    void Follow(const EachGround &robots)
    {
        Each half_rad{};
        for (size_t i = 0; i < robots.count; ++i)
            half_rad[i] = robots.omega_radps[i] * robots.dt_s / 2;
        const Turns turns(half_rad, robots.count);
        for (size_t i = 0; i < robots.count; ++i)
        {
            Course course = At(i);
            course.Follow({robots.vx_mps[i], robots.vy_mps[i], robots.omega_radps[i]}, robots.dt_s,
                          half_rad[i], turns.cos[i], turns.sin_over[i]);
            Take(i, course);
        }
    }

private:
    EachPose poses_;
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

// SPDX-License-Identifier: Apache-2.0
#include "plant/planar_plant.h"

#include <cmath>

namespace twin
{

Pose2 AlongArc(const Pose2 &from, const Twist &v, double dt_s)
{
    // Chord of the arc: its direction is the middle heading, its length shrinks by sin(a)/a.
    const double half_rad = v.omega_radps * dt_s / 2;
    const double chord_s = dt_s * SinOver(half_rad);
    const double middle_rad = from.theta_rad + half_rad;
    const double c = std::cos(middle_rad), s = std::sin(middle_rad);
    return {from.x_m + chord_s * (c * v.vx_mps - s * v.vy_mps),
            from.y_m + chord_s * (s * v.vx_mps + c * v.vy_mps), from.theta_rad + 2 * half_rad};
}

void PlanarStep(const DriveChain &chain, const Command &command, double t_s, double dt_s,
                RobotState &state, Random *random)
{
    const WheelMotion motion = chain.DriveWheels(command, t_s, dt_s, state);
    const Twist velocity = chain.BodyTwist(motion, t_s, dt_s, state, random);
    state.pose = AlongArc(state.pose, velocity, dt_s);
}

PlanarPlant::PlanarPlant(const std::vector<Model> &models, const std::vector<Pose2> &starts,
                         uint64_t seed)
{
    for (size_t i = 0; i < models.size(); ++i)
    {
        DriveChain chain(models[i]);
        RobotState state = chain.Start(starts[i]);
        robots_.push_back({std::move(chain),
                           Random(seed, static_cast<int>(i), "drive_noise"),
                           std::move(state),
                           {}});
    }
}

void PlanarPlant::SetCommand(int robot, const Command &command)
{
    robots_[static_cast<size_t>(robot)].command = command;
}

void PlanarPlant::Step(double dt_s)
{
    for (Member &m : robots_)
        PlanarStep(m.chain, m.command, t_s_, dt_s, m.state, &m.random);
    t_s_ += dt_s;
}

const RobotState &PlanarPlant::State(int robot) const
{
    return robots_[static_cast<size_t>(robot)].state;
}

void PlanarPlant::Move(int robot, const Pose2 &pose)
{
    robots_[static_cast<size_t>(robot)].state.pose = pose;
}

}  // namespace twin

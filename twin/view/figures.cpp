// SPDX-License-Identifier: Apache-2.0
#include "figures.h"

#include <cmath>

#include "plant_mujoco/mujoco_plant.h"

namespace twin
{
namespace
{

constexpr std::array kWheelNames{"fl", "fr", "rl", "rr"};

}  // namespace

Figures::Figures(const std::string &mjcf, size_t robots)
{
    const MujocoPlant plant(mjcf, std::vector<Model>(robots), std::vector<Pose2>(robots),
                            {.visuals = true});
    model_.reset(mj_copyModel(nullptr, plant.model()));
    mjModel *m = model_.get();
    data_.reset(mj_makeData(m));
    const auto address = [m](size_t robot, const char *name) {
        const std::string full = NameInWorld(static_cast<int>(robot), name);
        return m->jnt_qposadr[mj_name2id(m, mjOBJ_JOINT, full.c_str())];
    };
    for (size_t i = 0; i < robots; ++i)
    {
        Joints joints{};
        for (size_t k = 0; k < kMaxWheels; ++k)
            joints.wheels[k] = address(i, kWheelNames[k]);
        const int wheel = mj_name2id(m, mjOBJ_GEOM, NameInWorld(static_cast<int>(i), "fl").c_str());
        joints.base = m->jnt_qposadr[m->body_jntadr[m->body_rootid[m->geom_bodyid[wheel]]]];
        wheel_radius_m_ = m->geom_size[3 * wheel];
        joints_.push_back(joints);
    }
}

void Figures::Place(const Swarm &swarm)
{
    const double dt_s = swarm.TimeS() - data_->time;
    data_->time = swarm.TimeS();
    for (size_t i = 0; i < joints_.size(); ++i)
    {
        const RobotState &state = swarm.State(static_cast<int>(i));
        mjtNum *q = data_->qpos + joints_[i].base;
        q[0] = state.pose.x_m;
        q[1] = state.pose.y_m;
        q[3] = std::cos(state.pose.theta_rad / 2);
        q[4] = q[5] = 0;
        q[6] = std::sin(state.pose.theta_rad / 2);
        for (size_t k = 0; k < kMaxWheels; ++k)
            data_->qpos[joints_[i].wheels[k]] += state.rim_mps[k] / wheel_radius_m_ * dt_s;
    }
    mj_fwdPosition(model_.get(), data_.get());
}

int Figures::CameraOf(int robot) const
{
    return mj_name2id(model_.get(), mjOBJ_CAMERA, NameInWorld(robot, "cam").c_str());
}

}  // namespace twin

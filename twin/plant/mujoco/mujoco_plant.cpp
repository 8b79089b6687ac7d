// SPDX-License-Identifier: Apache-2.0
#include "plant_mujoco/mujoco_plant.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <stdexcept>

#include "mujoco_world.h"

namespace twin
{
namespace
{

constexpr double kFastest_mps = 1e6;     // nothing that drives comes near it
constexpr double kDragSpeed_mps = 0.02;  // roller drag is fully there at about twice this speed

int Id(const mjModel *m, mjtObj type, int robot, const char *name)
{
    return mj_name2id(m, type, NameInWorld(robot, name).c_str());
}

void PrintWarning(const char *text)
{
    std::fprintf(stderr, "mujoco: %s\n", text);
}

// Warnings and errors: by itself MuJoCo also writes them to MUJOCO_LOG.TXT in the working
// directory.
void LogToStderrAlone()
{
    mju_user_warning = PrintWarning;
    mjLogConfig config = mju_getLogConfig();
    config.logto_file = false;
    mju_setLogConfig(config);
}

void CheckInputs(const std::vector<Model> &models, const std::vector<Pose2> &starts,
                 const MujocoOptions &options)
{
    if (models.empty() || models.size() > kMaxRobots || models.size() != starts.size())
        throw std::invalid_argument("mujoco plant: " + std::to_string(models.size()) +
                                    " models and " + std::to_string(starts.size()) +
                                    " start poses: give one of each per robot, for 1 to " +
                                    std::to_string(kMaxRobots) + " robots");
    if (!(options.timestep_s > 0 && options.timestep_s <= 0.01))
        throw std::invalid_argument(
            "mujoco plant: timestep_s " + std::to_string(options.timestep_s) +
            " must be above 0 and at most 0.01: contacts are stiffer than that");
    for (const Model &model : models)
    {
        if (model.base.wheels == WheelKind::kAckermann)
            throw std::invalid_argument(
                "mujoco plant: base.wheels is \"ackermann\", and steered wheels are built in the "
                "planar plant alone: use --plant planar");
        if (model.base.wheels != models[0].base.wheels)
            throw std::invalid_argument("mujoco plant: all robots must have the same base.wheels");
    }
}

// The wheels at their places in the MJCF file.
std::vector<Wheel> WheelsIn(const mjModel *m, const Model &model)
{
    std::vector<Wheel> wheels = model.MakeWheels();
    for (Wheel &wheel : wheels)
    {
        const mjtNum *hub = m->body_pos + 3 * m->geom_bodyid[Id(m, mjOBJ_GEOM, 0, wheel.name)];
        wheel.x_m = hub[0];
        wheel.y_m = hub[1];
    }
    return wheels;
}

// Drag across the grip of one wheel that carries its share of the robot.
double RollerDrag(const mjModel *m, const std::vector<Wheel> &wheels)
{
    const int numeric = mj_name2id(m, mjOBJ_NUMERIC, kRollerDrag);
    if (numeric < 0)
        return 0;
    const int base = m->body_rootid[m->geom_bodyid[Id(m, mjOBJ_GEOM, 0, wheels[0].name)]];
    const double load_N =
        m->body_subtreemass[base] * -m->opt.gravity[2] / static_cast<double>(wheels.size());
    return m->numeric_data[m->numeric_adr[numeric]] * load_N;
}

}  // namespace

MujocoPlant::MujocoPlant(const std::string &mjcf, const std::vector<Model> &models,
                         const std::vector<Pose2> &starts, const MujocoOptions &options)
    : timestep_s_(options.timestep_s),
      kinematics_(Robot{}, WheelKind::kMecanum),
      world_(SolidOf(options.world))
{
    CheckInputs(models, starts, options);
    LogToStderrAlone();
    model_.reset(CompileWorld(mjcf, models, starts, options));
    data_.reset(mj_makeData(model_.get()));
    const std::vector<Wheel> wheels = WheelsIn(model_.get(), models[0]);
    const int first = Id(model_.get(), mjOBJ_GEOM, 0, wheels[0].name);
    wheel_radius_m_ = model_->geom_size[3 * first];
    kinematics_ = Kinematics(wheels);
    drag_N_ = RollerDrag(model_.get(), wheels);
    for (size_t i = 0; i < models.size(); ++i)
        robots_.push_back(MakeMember(static_cast<int>(i), models[i], starts[i], options.seed));
    mj_forward(model_.get(), data_.get());
}

MujocoPlant::Member MujocoPlant::MakeMember(int robot, const Model &model, const Pose2 &start,
                                            uint64_t seed) const
{
    const mjModel *m = model_.get();
    DriveChain chain(model);
    const RobotState state = chain.Start(start);
    const std::vector<Wheel> layout = model.MakeWheels();
    const int base = m->body_rootid[m->geom_bodyid[Id(m, mjOBJ_GEOM, robot, layout[0].name)]];
    const int joint = m->body_jntadr[base];
    std::vector<DrivenWheel> wheels;
    for (const Wheel &wheel : layout)
    {
        const mjtNum *hub = m->body_pos + 3 * m->geom_bodyid[Id(m, mjOBJ_GEOM, robot, wheel.name)];
        // Square to the grip, unit length.
        const double g_x = wheel.grip_x(), g_y = wheel.grip_y();
        const double length =
            wheel.tread == Tread::kPlain ? kNoLimit : std::sqrt(g_x * g_x + g_y * g_y);
        wheels.push_back({m->jnt_dofadr[Id(m, mjOBJ_JOINT, robot, wheel.name)],
                          Id(m, mjOBJ_ACTUATOR, robot, wheel.name), hub[0], hub[1], wheel.roll_x,
                          wheel.roll_y, -g_y / length, g_x / length});
    }
    return {std::move(chain),
            Random(seed, robot, "drive_noise"),
            state,
            state,
            {},
            m->jnt_qposadr[joint],
            m->jnt_dofadr[joint],
            std::move(wheels),
            {}};
}

void MujocoPlant::SetCommand(int robot, const Command &command)
{
    robots_[static_cast<size_t>(robot)].command = command;
}

const RobotState &MujocoPlant::State(int robot) const
{
    return robots_[static_cast<size_t>(robot)].state;
}

void MujocoPlant::Step(double dt_s)
{
    const int steps = std::max(1, static_cast<int>(std::ceil(dt_s / timestep_s_ - 1e-9)));
    model_->opt.timestep = dt_s / steps;
    for (Member &member : robots_)
        member.state.vx_mps = member.state.vy_mps = member.state.omega_radps = 0;
    for (int i = 0; i < steps; ++i)
    {
        MoveWorld();
        for (Member &member : robots_)
        {
            Drive(member, model_->opt.timestep);
            DragRollers(member);
        }
        mj_step(model_.get(), data_.get());
        for (Member &member : robots_)
            Sense(member);
    }
    for (Member &member : robots_)
    {
        member.state.vx_mps /= steps;
        member.state.vy_mps /= steps;
        member.state.omega_radps /= steps;
    }
    CheckStable();
}

// Where they are at the end of the physics step.
void MujocoPlant::MoveWorld()
{
    for (size_t i = 0; i < world_.size(); ++i)
    {
        const Eigen::Vector2d at_m = world_[i].At(data_->time + model_->opt.timestep).from_m;
        data_->mocap_pos[3 * i] = at_m.x();
        data_->mocap_pos[3 * i + 1] = at_m.y();
    }
}

// The wheels are told to turn so that, where they grip, the body moves as the drive chain says.
// What the wheels disagree about remains: they work against each other.
void MujocoPlant::Drive(Member &member, double dt_s)
{
    RobotState &memory = member.chain_state;
    memory.pose = member.state.pose;
    const double t_s = data_->time;
    const WheelMotion motion = member.chain.DriveWheels(member.command, t_s, dt_s, memory);
    const Twist wanted = member.chain.BodyTwist(motion, t_s, dt_s, memory, &member.random);
    CheckBounded(member, wanted);
    const Twist rolled = kinematics_.Forward(motion);
    member.offset_mps = kinematics_
                            .Inverse({wanted.vx_mps - rolled.vx_mps, wanted.vy_mps - rolled.vy_mps,
                                      wanted.omega_radps - rolled.omega_radps})
                            .rim_mps;
    for (size_t k = 0; k < member.wheels.size(); ++k)
        data_->ctrl[member.wheels[k].actuator] =
            (motion.rim_mps[k] + member.offset_mps[k]) / wheel_radius_m_;
}

// Across its grip a wheel rolls on its rollers, at w over the floor: drag -F tanh(w / w0) along
// that direction e, on the body and, through the axle, on the wheel.
void MujocoPlant::DragRollers(const Member &member)
{
    const mjtNum *v_world = data_->qvel + member.dof, omega = v_world[5];
    mjtNum to_body[4], v[3], force[3] = {0, 0, 0}, torque = 0;
    mju_negQuat(to_body, data_->qpos + member.qpos + 3);
    mju_rotVecQuat(v, v_world, to_body);
    for (const DrivenWheel &wheel : member.wheels)
    {
        const double e_x = wheel.free_x, e_y = wheel.free_y;
        const double rim_mps = data_->qvel[wheel.dof] * wheel_radius_m_;
        const double w_mps = e_x * (v[0] - omega * wheel.y_m - rim_mps * wheel.roll_x) +
                             e_y * (v[1] + omega * wheel.x_m - rim_mps * wheel.roll_y);
        const double drag_N = -drag_N_ * std::tanh(w_mps / kDragSpeed_mps);
        force[0] += e_x * drag_N;
        force[1] += e_y * drag_N;
        torque += (wheel.x_m * e_y - wheel.y_m * e_x) * drag_N;
        const double along = e_x * wheel.roll_x + e_y * wheel.roll_y;
        data_->qfrc_applied[wheel.dof] = -wheel_radius_m_ * along * drag_N;
    }
    mju_rotVecQuat(data_->qfrc_applied + member.dof, force, data_->qpos + member.qpos + 3);
    data_->qfrc_applied[member.dof + 5] = torque;
}

// Pose now (heading without jumps), velocity added to the sum over the step.
void MujocoPlant::Sense(Member &member) const
{
    RobotState &state = member.state;
    const mjtNum *q = data_->qpos + member.qpos, *v = data_->qvel + member.dof;
    const double yaw_rad =
        std::atan2(2 * (q[3] * q[6] + q[4] * q[5]), 1 - 2 * (q[5] * q[5] + q[6] * q[6]));
    const double turned_rad = std::remainder(yaw_rad - state.pose.theta_rad, 2 * std::numbers::pi);
    state.pose = {q[0], q[1], state.pose.theta_rad + turned_rad};
    const double c = std::cos(yaw_rad), s = std::sin(yaw_rad);
    state.vx_mps += c * v[0] + s * v[1];
    state.vy_mps += -s * v[0] + c * v[1];
    state.omega_radps += v[5];
    for (size_t k = 0; k < member.wheels.size(); ++k)
        state.rim_mps[k] =
            data_->qvel[member.wheels[k].dof] * wheel_radius_m_ - member.offset_mps[k];
}

// Wheels that slip would drive on, however fast they are told to turn; NaN compares false.
void MujocoPlant::CheckBounded(const Member &member, const Twist &wanted) const
{
    const double fastest_mps =
        std::max({std::abs(wanted.vx_mps), std::abs(wanted.vy_mps), std::abs(wanted.omega_radps)});
    if (fastest_mps < kFastest_mps)
        return;
    throw std::invalid_argument("robot " + std::to_string(&member - robots_.data()) +
                                " is told to drive faster than anything after " +
                                std::to_string(data_->time) +
                                " s: the model grows without bound; correct its formulas and "
                                "numbers");
}

void MujocoPlant::CheckStable() const
{
    for (const mjtWarning kind : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC})
        if (data_->warning[kind].number)
            throw std::runtime_error("mujoco plant: the simulation became unstable before t = " +
                                     std::to_string(data_->time) +
                                     " s: use a shorter timestep, or put overlapping robots apart");
}

}  // namespace twin

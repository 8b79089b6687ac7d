// SPDX-License-Identifier: Apache-2.0
// The plant with forces: robots of an MJCF file in MuJoCo, driven through the same chain and
// effects as the planar plant. Wheels slip, robots push each other, walls hold.
#ifndef PLANT_MUJOCO_MUJOCO_PLANT_H
#define PLANT_MUJOCO_MUJOCO_PLANT_H

#include <mujoco/mujoco.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "plant/drive_chain.h"
#include "plant/world_body.h"

namespace twin
{

struct MujocoOptions
{
    double timestep_s = 0.002;                   // longest physics step
    std::optional<double> arena_half_width_m{};  // walls of a square arena around the origin
    uint64_t seed = 0;                           // of the drive noise
    bool visuals = false;  // keep what is only looked at: for a viewer or a video
    // For many worlds: servos stand still, and sensors of the file read nothing.
    bool simplified = false;
    std::vector<WorldBody> world{};  // the solid ones stop robots
};

// What sweeps run; kSweepPhysics names all of it that changes a result, and stands in every sweep's
// hash: a change here is a change there.
constexpr double kSweepStep_s = 0.005;
constexpr const char *kSweepPhysics = "steps of at most 5 ms, elliptic cones";
inline MujocoOptions SweepOptions(uint64_t seed)
{
    return {.timestep_s = kSweepStep_s, .seed = seed, .simplified = true};
}

// How `name` of the MJCF file is called for one robot of the world: "r03_cam".
std::string NameInWorld(int robot, const std::string &name);

class MujocoPlant : public Plant
{
public:
    // `mjcf` is the file of one robot, or of a scene with one robot; wheels are joints, geoms and
    // actuators named as the model's wheels. Without a file ("") the robot is made of the model's
    // numbers. One model (Model::ForRobot) and start pose per robot, all with the same wheels.
    // Throws std::invalid_argument in one sentence if the file or the models do not fit.
    MujocoPlant(const std::string &mjcf, const std::vector<Model> &models,
                const std::vector<Pose2> &starts, const MujocoOptions &options);

    int Size() const override { return static_cast<int>(robots_.size()); }
    void SetCommand(int robot, const Command &command) override;
    // Throws std::runtime_error if the simulation became unstable, std::invalid_argument if the
    // model grows without bound.
    void Step(double dt_s) override;
    // `rim_mps` is what wheel encoders would read: the hinges, less what gains and ground effects
    // ask of them so that the body moves as they say.
    const RobotState &State(int robot) const override;
    bool IsSilent(int robot) const override
    {
        return robots_[static_cast<size_t>(robot)].chain.IsSilent();
    }
    double TimeS() const override { return data_->time; }

    // For viewers, videos and external forces.
    const mjModel *model() const { return model_.get(); }
    mjData *data() { return data_.get(); }

private:
    struct ModelDeleter
    {
        void operator()(mjModel *model) const { mj_deleteModel(model); }
    };
    struct DataDeleter
    {
        void operator()(mjData *data) const { mj_deleteData(data); }
    };
    struct DrivenWheel
    {
        int dof, actuator;
        double x_m, y_m;        // place on the robot
        double roll_x, roll_y;  // where it rolls
        double free_x, free_y;  // where its rollers let it go; both 0: it has none
    };
    struct Member
    {
        DriveChain chain;
        Random random;
        RobotState chain_state;  // the chain's own memory: its rims know nothing of contacts
        RobotState state;        // what happened
        Command command;
        int qpos, dof;  // of the free joint
        std::vector<DrivenWheel> wheels;
        Wheels offset_mps;  // rim speed asked beyond the chain's, for gains and ground effects
    };
    Member MakeMember(int robot, const Model &model, const Pose2 &start, uint64_t seed) const;
    void MoveWorld();
    void Drive(Member &member, double dt_s);
    void DragRollers(const Member &member);
    void Sense(Member &member) const;
    void CheckBounded(const Member &member, const Twist &wanted) const;
    void CheckStable() const;

    std::unique_ptr<mjModel, ModelDeleter> model_;
    std::unique_ptr<mjData, DataDeleter> data_;
    double timestep_s_, wheel_radius_m_, drag_N_;
    Kinematics kinematics_;  // of the MJCF file's geometry
    std::vector<Member> robots_;
    std::vector<WorldBody> world_;  // one a mocap body
};

}  // namespace twin

#endif

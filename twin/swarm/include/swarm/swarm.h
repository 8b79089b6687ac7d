// SPDX-License-Identifier: Apache-2.0
// N robots in lockstep. One step is one control period: all sense the same instant, all decide,
// then all move.
#ifndef SWARM_SWARM_H
#define SWARM_SWARM_H

#include <memory>
#include <vector>

#include "fw/step.h"
#include "model_file/model.h"
#include "plant/plant.h"
#include "sensor/robot_sensor.h"
#include "swarm/cell_grid.h"
#include "swarm/script.h"

namespace twin
{

struct SwarmOptions
{
    uint64_t seed = 0;           // of the sensors' errors
    int64_t start_utime_us = 0;  // the robots' clock at the start
    // Longest step of the plant; a control period is split evenly. With motor lag, 22 ms moves a
    // path by micrometres; shorter steps serve those who want to know poses in between.
    double max_step_s = 0.025;
    // From this many robots on, neighbours are found with a grid; results are the same to the bit.
    size_t grid_from = kGridPays;
    std::vector<Colour> colours = {};   // of the robots' targets; empty: TargetColour()
    std::vector<WorldBody> world = {};  // what else there is to see; the plant has the same
};

// Into how many substeps of at most `max_step_s` a control period is split.
int SubstepCount(double period_s, double max_step_s);

// What the plant is told when the firmware has chosen this input, and mixed it to these duties.
Command CommandFor(const Base &base, const fw_input &input, const int8_t *wheel_duty_pct);

class Swarm
{
public:
    // One model per robot (DrawRobots), in the plant's order, and one table per robot. Every
    // decision is the firmware's. Throws std::invalid_argument if the firmware cannot drive a
    // model.
    Swarm(std::unique_ptr<Plant> plant, const std::vector<Model> &models,
          const std::vector<fw_table> &tables, const SwarmOptions &options);

    // From now on `robot` plays `script` instead of its table; nullptr: its table again. Throws
    // std::invalid_argument if the model has no wheels to give the script's duties to.
    void Play(int robot, std::shared_ptr<const Script> script);
    // What an operator may tell a robot: stand or go, and which table. Throws std::invalid_argument
    // if the firmware refuses the table.
    void SetRunning(int robot, bool running);
    void Select(int robot, const fw_behavior &behavior);

    // From now on `robot` decides by `sensor`; at first each decides by a ConeSensor.
    void SetSensor(int robot, std::unique_ptr<RobotSensor> sensor);

    // Decide(), then Substeps() times Advance().
    void Step();
    // Senses, decides, commands.
    void Decide();
    // Moves on by one substep.
    void Advance();
    int Substeps() const { return substeps_; }

    int Size() const { return static_cast<int>(members_.size()); }
    double PeriodS() const { return period_s_; }
    // Steps begun so far.
    int64_t StepCount() const { return step_count_; }
    // Time since the start: a whole number of substeps.
    double TimeS() const;
    // The robots' clock.
    int64_t UtimeUs() const;
    const RobotState &State(int robot) const { return plant_->State(robot); }
    // As Plant::IsSilent.
    bool IsSilent(int robot) const { return plant_->IsSilent(robot); }
    // What the firmware decided last.
    const fw_output &Output(int robot) const;
    // What the plant was told of that output, in the terms of the model's drive.
    Command Told(int robot) const;
    double BatteryV(int robot) const;
    // What the robot's sensor drew last; empty if it draws nothing.
    Image LastImage(int robot) const;
    const std::vector<WorldBody> &World() const { return world_; }

private:
    struct Member
    {
        fw_ctx firmware;
        fw_output output;
        std::unique_ptr<RobotSensor> sensor;
        Base base;
        double battery_V;
        std::shared_ptr<const Script> script;
        double script_begin_s;
    };
    bool UsesGrid() const;
    void FindReach();
    void LookAtWorld();
    void Expose(int robot, int64_t now_us);
    void DecideOne(Member &member, int64_t now_us);

    std::unique_ptr<Plant> plant_;
    std::vector<Member> members_;
    std::vector<Pose2> poses_, near_poses_;
    std::vector<Colour> colours_, near_colours_;
    std::vector<WorldBody> world_;
    std::vector<SeenBody> bodies_;
    CellGrid grid_;
    size_t grid_from_;
    double reach_m_ = 0;  // the longest finite one of a sensor; 0: none
    double period_s_;
    int substeps_;
    int64_t start_utime_us_;
    int64_t step_count_ = 0, substep_count_ = 0;
};

}  // namespace twin

#endif

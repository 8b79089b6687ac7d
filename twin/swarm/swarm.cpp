// SPDX-License-Identifier: Apache-2.0
#include "swarm/swarm.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <stdexcept>

#include "plant/kinematics.h"
#include "sensor/cone_sensor.h"
#include "swarm/robots.h"

namespace twin
{
namespace
{

// The pack: two cells that fall from 8.2 V full to 7.0 V empty over 1.8 Ah (maker's data), feeding
// computer and camera with 0.6 A and each motor with up to 0.17 A (maker's data, no load). The
// current of the computer is a guess.
constexpr double kFullPack_V = 8.2, kEmptyPack_V = 7.0, kPackCharge_As = 1.8 * 3600;
constexpr double kComputer_A = 0.6, kMotors_A = 4 * 0.17;

fw_config ConfigFor(const std::vector<fw_bit> &bits, const fw_table &table)
{
    CheckBits(table, bits.size());
    fw_config config = fw_config_default();
    config.table = table;
    config.bit_count = static_cast<int32_t>(bits.size());
    std::ranges::copy(bits, config.bits);
    return config;
}

// Whether the duties that the firmware mixes of speed and turn drive these wheels: all alike go
// straight ahead, and left against right turns on the spot. Of any other layout it does not hold.
bool IsDrivenByMixing(const Model &model)
{
    const Kinematics kinematics(model.robot, model.base.wheels);
    const auto moved = [&](double left, double right) {
        return kinematics.Forward({{left, right, left, right}, 0});
    };
    const Twist ahead = moved(1, 1), turn = moved(-1, 1);
    const double lever_m = model.robot.half_wheelbase_m + model.robot.half_track_m;
    constexpr double kNone = 1e-6;  // of a rim speed of 1
    return ahead.vx_mps > 0.5 && std::abs(ahead.vy_mps) < kNone &&
           lever_m * std::abs(ahead.omega_radps) < kNone && turn.omega_radps > 0 &&
           std::hypot(turn.vx_mps, turn.vy_mps) < kNone;
}

void CheckModel(const Model &model, const fw_config &config)
{
    if (model.base.drive == Drive::kWheelSpeed)
        throw std::invalid_argument(
            "the model's base.drive is 'wheel_speed', which the firmware cannot command: a swarm "
            "needs 'duty', 'twist' or 'steering'");
    if (model.base.drive == Drive::kDuty && !IsDrivenByMixing(model))
        throw std::invalid_argument(
            std::string("the model's base.wheels is '") + WheelKindName(model.base.wheels) +
            "', and the firmware mixes duties for left and right wheels alone: a swarm of such "
            "robots needs base.drive = 'twist'");
    const double timeout_s = static_cast<double>(config.frame_timeout_us) * 1e-6;
    if (model.sensor.delay_s > timeout_s)
        throw std::invalid_argument("sensor.delay_s = " + std::to_string(model.sensor.delay_s) +
                                    " s is above the firmware's frame time-out of " +
                                    std::to_string(timeout_s) + " s: the robots would never move");
}

}  // namespace

int SubstepCount(double period_s, double max_step_s)
{
    return static_cast<int>(std::ceil(period_s / max_step_s - 1e-9));
}

Command CommandFor(const Base &base, const fw_input &input, const int8_t *wheel_duty_pct)
{
    Command command;
    const double turn_input = input.turn_input_milli / 1000.0;
    if (base.drive == Drive::kTwist)
        command.value = {input.speed_input_pct * base.speed_per_input_mps, 0,
                         turn_input * base.turn_per_input_radps, 0};
    else if (base.drive == Drive::kSteering)
        command.value = {input.speed_input_pct * base.speed_per_input_mps,
                         turn_input * base.steering_per_input_rad, 0, 0};
    else
        for (size_t k = 0; k < kMaxWheels; ++k)
            command.value[k] = wheel_duty_pct[k] / 100.0;
    return command;
}

Swarm::Swarm(std::unique_ptr<Plant> plant, const std::vector<Model> &models,
             const std::vector<fw_table> &tables, const SwarmOptions &options)
    : plant_(std::move(plant)),
      poses_(models.size()),
      colours_(options.colours),
      world_(options.world),
      grid_from_(options.grid_from),
      period_s_(models.front().base.control_period_s),
      substeps_(SubstepCount(period_s_, options.max_step_s)),
      start_utime_us_(options.start_utime_us)
{
    for (size_t i = 0; i < models.size(); ++i)
    {
        const DetectionModel detection = models[i].MakeDetectionModel();
        const std::vector<fw_bit> bits = MakeBits(models[i]);
        const fw_config config = ConfigFor(bits, tables[i]);
        CheckModel(models[i], config);
        members_.push_back(
            {{},
             {},
             std::make_unique<ConeSensor>(detection, bits, static_cast<int>(i), options.seed),
             models[i].base,
             kFullPack_V,
             nullptr,
             0});
        if (const fw_err error = fw_init(&members_.back().firmware, &config); error != FW_OK)
            throw std::invalid_argument(std::string("the firmware refuses its configuration: ") +
                                        fw_err_str(error));
    }
    FindReach();
}

void Swarm::FindReach()
{
    reach_m_ = 0;
    for (const Member &member : members_)
        if (const double reach_m = member.sensor->ReachM(); std::isfinite(reach_m))
            reach_m_ = std::max(reach_m_, reach_m);
}

void Swarm::Play(int robot, std::shared_ptr<const Script> script)
{
    Member &member = members_[static_cast<size_t>(robot)];
    if (script && script->has_duties() && member.base.drive != Drive::kDuty)
        throw std::invalid_argument(
            "the script gives wheel duties, but the model's base.drive is 'twist' or 'steering': "
            "give speed_input and turn_input instead");
    member.script = std::move(script);
    member.script_begin_s = TimeS();
}

void Swarm::SetRunning(int robot, bool running)
{
    fw_set_running(&members_[static_cast<size_t>(robot)].firmware, running);
}

void Swarm::Select(int robot, const fw_behavior &behavior)
{
    Member &member = members_[static_cast<size_t>(robot)];
    CheckBits(behavior.table, static_cast<size_t>(member.firmware.config.bit_count));
    if (fw_set_table(&member.firmware, &behavior.table) != FW_OK)
        throw std::invalid_argument("the firmware refuses the table");
    member.sensor->Select(behavior);
}

void Swarm::SetSensor(int robot, std::unique_ptr<RobotSensor> sensor)
{
    members_[static_cast<size_t>(robot)].sensor = std::move(sensor);
    FindReach();
}

void Swarm::Step()
{
    Decide();
    for (int i = 0; i < substeps_; ++i)
        Advance();
}

void Swarm::Decide()
{
    for (int i = 0; i < Size(); ++i)
        poses_[static_cast<size_t>(i)] = plant_->State(i).pose;
    const int64_t now_us = UtimeUs();
    LookAtWorld();
    if (UsesGrid())
        grid_.Fill(poses_, reach_m_);
    for (int i = 0; i < Size(); ++i)
    {
        Member &member = members_[static_cast<size_t>(i)];
        Expose(i, now_us);
        DecideOne(member, now_us);
        plant_->SetCommand(i, Told(i));
    }
    ++step_count_;
}

void Swarm::LookAtWorld()
{
    bodies_.clear();
    for (const WorldBody &body : world_)
    {
        std::optional<Colour> colour;
        if (!body.colour.empty())
            colour = ColourNamed(body.colour);
        bodies_.push_back({body.At(TimeS()), body.height_m, colour, body.is_solid});
    }
}

bool Swarm::UsesGrid() const
{
    return members_.size() >= grid_from_ && reach_m_ > 0;
}

void Swarm::Expose(int robot, int64_t now_us)
{
    RobotSensor &sensor = *members_[static_cast<size_t>(robot)].sensor;
    if (!UsesGrid() || !std::isfinite(sensor.ReachM()))
    {
        sensor.Expose({poses_, static_cast<size_t>(robot), colours_, bodies_}, now_us);
        return;
    }
    near_poses_.clear();
    near_colours_.clear();
    size_t self = 0;
    for (const size_t i : grid_.Near(static_cast<size_t>(robot)))
    {
        if (i == static_cast<size_t>(robot))
            self = near_poses_.size();
        near_poses_.push_back(poses_[i]);
        if (!colours_.empty())
            near_colours_.push_back(colours_[i]);
    }
    sensor.Expose({near_poses_, self, near_colours_, bodies_}, now_us);
}

void Swarm::DecideOne(Member &member, int64_t now_us)
{
    if (member.script)
    {
        const ScriptRow idle{};
        const ScriptRow *row = member.script->At(TimeS() - member.script_begin_s);
        const ScriptRow &now = row ? *row : idle;
        if (member.script->has_duties())
            fw_step_script_duty(&member.firmware, now.wheel_duty_pct.data(), &member.output);
        else
            fw_step_script_input(&member.firmware, &now.input, &member.output);
    }
    else
        member.sensor->Decide(now_us, member.firmware, member.output);

    double duty = 0;
    for (const int8_t pct : member.output.wheel_duty_pct)
        duty += std::abs(pct) / 100.0 / kMaxWheels;
    const double charge_As = (kComputer_A + kMotors_A * duty) * period_s_;
    member.battery_V -= (kFullPack_V - kEmptyPack_V) * charge_As / kPackCharge_As;
}

void Swarm::Advance()
{
    plant_->Step(period_s_ / substeps_);
    ++substep_count_;
}

double Swarm::TimeS() const
{
    return static_cast<double>(substep_count_) * period_s_ / substeps_;
}

int64_t Swarm::UtimeUs() const
{
    return start_utime_us_ + std::llround(TimeS() * 1e6);
}

const fw_output &Swarm::Output(int robot) const
{
    return members_[static_cast<size_t>(robot)].output;
}

Command Swarm::Told(int robot) const
{
    const Member &member = members_[static_cast<size_t>(robot)];
    const fw_output &out = member.output;
    const fw_input input{static_cast<int16_t>(out.speed_input_pct),
                         static_cast<int16_t>(out.turn_input_milli)};
    Command command = CommandFor(member.base, input, out.wheel_duty_pct);
    command.battery_V = member.battery_V;
    return command;
}

double Swarm::BatteryV(int robot) const
{
    return members_[static_cast<size_t>(robot)].battery_V;
}

Image Swarm::LastImage(int robot) const
{
    return members_[static_cast<size_t>(robot)].sensor->LastImage();
}

}  // namespace twin

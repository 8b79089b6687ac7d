// SPDX-License-Identifier: Apache-2.0
// A robot model: the numbers of a model file (TOML), checked, with a name for every one of them.
#ifndef MODEL_FILE_MODEL_H
#define MODEL_FILE_MODEL_H

#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "effects/effect.h"
#include "model_file/wheels.h"

namespace twin
{

struct Robot
{
    double wheel_radius_m = 0.0325;
    double half_wheelbase_m = 0.059;
    double half_track_m = 0.067;
    double body_radius_m = 0.1;
    double mass_kg = 1.2;           // acts in MuJoCo, where a file or a call states it
    double max_steering_rad = 0.5;  // Ackermann
    double battery_nominal_V = 7.4;
};

// Command to velocity, before any effect.
struct Base
{
    Drive drive = Drive::kDuty;
    WheelKind wheels = WheelKind::kMecanum;
    std::vector<double> duty_pct{0, 100};          // ascending from 0
    std::vector<double> wheel_speed_mps{0, 0.36};  // rim speed at that duty, driving straight
    double speed_per_input_mps = 0.0036;           // twist, steering: speed of speed_input 1
    double turn_per_input_radps = 1.0;             // twist drive: rate of turn_input 1
    double steering_per_input_rad = 0.25;          // steering drive: angle of turn_input 1
    double forward_gain = 1, sideways_gain = 1, yaw_gain = 1;
    double motor_lag_s = 0;
    double steering_lag_s = 0;  // Ackermann: time constant of the steering
    double control_period_s = 0.022;
};

struct Sensor
{
    double range_m = 1.1, range_std_m = 0;
    double cone_rad = 0.855, cone_std_rad = 0;  // full opening angle
    double target_radius_m = 0;                 // 0: only the other robot's centre is seen
    double false_negative_rate = 0, false_positive_rate = 0;  // per frame
    double delay_s = 0;
    double vote_frames = 1;  // seen if more than half of the last frames show it
    // What is looked for, as in the robot's configuration: see fw_bit_parse().
    std::vector<std::string> bits{"all"};
};

struct Noise
{
    double sensor_m = 0, sensor_rad = 0;  // motion capture, white
    // Velocity disturbance while moving, first order: standard deviation and memory.
    double drive_mps = 0, drive_s = 0.15;
    double drive_radps = 0, drive_turn_s = 0.15;
};

// Spread over robots of the factors on speed and turn rate.
struct Idiosyncrasy
{
    double theta_a1_std = 0, theta_a2_std = 0;
};

// Motion capture's clock against the robot's: t_capture = t_robot + offset + rate * t_robot.
struct Clock
{
    bool known = false;
    bool same = false;  // declared to be one clock: offset and rate are zero, not to be estimated
    double offset_s = 0, rate_ppm = 0;
};

// What is so in one log alone.
struct Frame
{
    double heading_rad = 0;  // of the robot where poses have heading zero because none was recorded
    Wheels wheel_rad{};      // angles at which its wheels begin
};

struct EffectInstance
{
    const EffectSpec *spec;
    std::vector<Parameter> parameters;  // of this model's robot: per-wheel ones for each wheel
    std::vector<std::string> texts;     // in the order of spec->texts
    const char *stage;                  // where it acts, with these texts

    std::vector<double> Values() const;
    // Throws std::invalid_argument if a text makes no sense.
    BoundEffect Bind() const;
};

// What a model states and a plant cannot do.
struct Inert
{
    std::string name, why;
};

enum class PlantKind
{
    kPlanar,
    kMujoco
};

class Model
{
public:
    // Reads TOML text; `origin` is named in errors. Throws std::invalid_argument in one sentence.
    static Model FromToml(std::string_view text, const std::string &origin);
    // Finds `name` in the working directory, then among the installed models; reads it.
    static Model Load(const std::string &name);

    // Names of its effects in their order: "dead_zone", "dead_zone#2"; "equation#air" of a formula
    // that its author calls air.
    std::vector<std::string> Instances() const;
    // Every number of the model under its full name: "base.forward_gain", "dead_zone.width",
    // "dead_zone#2.width", "equation#air.drag".
    std::vector<Parameter> Parameters() const;
    // One of them. Throws std::invalid_argument if there is none of that name; so does Get().
    Parameter Find(const std::string &name) const;
    double Get(const std::string &name) const;
    // Where it is: for who sets it often.
    double &At(const std::string &name);
    // Throws std::invalid_argument if the name is unknown or the value out of bounds.
    void Set(const std::string &name, double value);
    // Appends an effect at its neutral values, with these texts in place of its default ones.
    // Throws if it or a text's name is unknown, if a text makes no sense, or if made for another
    // drive.
    void AddEffect(const std::string &name, const std::map<std::string, std::string> &texts = {});
    // Why this robot cannot have that effect, as a clause; empty: it can.
    std::string WhyNot(const EffectSpec &spec) const;
    void RemoveEffect(size_t index);
    // The model of one robot: its [robots.Rnn] overrides applied.
    Model ForRobot(int robot_id) const;
    // What this robot's camera sees and its body does on contact, effects included.
    DetectionModel MakeDetectionModel() const;
    Body MakeBody() const;
    // The robot's driven wheels.
    std::vector<Wheel> MakeWheels() const { return DrivenWheels(robot, base.wheels); }
    // Numbers that were stated, are not the default and do not act in that plant, and why.
    std::vector<Inert> InertIn(PlantKind plant) const;
    // Whether the file or Set() gave that number of a table.
    bool States(const std::string &name) const { return stated.contains(name); }

    Robot robot;
    Base base;
    Sensor sensor;
    Noise noise;
    Idiosyncrasy idiosyncrasy;
    Clock clock;
    Frame frame;
    double theta_a1 = 1, theta_a2 = 1;  // this robot's factors on speed and turn rate
    std::vector<EffectInstance> effects;
    // By robot: "range_m" and the like for fields, "wheel_gain.fl" for effects.
    std::map<int, std::map<std::string, double>> robot_overrides;
    std::set<std::string, std::less<>>
        stated;  // names of table numbers that did not come by default
};

// Path of an installed file (model, MJCF) or of one in the working directory; throws if there is
// none.
std::string FindModelFile(const std::string &name);

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// Names, values and per-robot copies of a model; parse.cpp reads the file.
#include "model_file/model.h"

#include <algorithm>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "effects/own_numbers.h"
#include "fields.h"

namespace twin
{
namespace
{

// A text of an effect; empty: it has none of that name.
std::string TextOf(const EffectInstance &effect, std::string_view name)
{
    for (size_t i = 0; i < effect.texts.size(); ++i)
        if (effect.spec->texts[i].name == name)
            return effect.texts[i];
    return "";
}

// "dead_zone", and "equation#air" of a formula that its author calls air.
std::string KindName(const EffectInstance &effect)
{
    const std::string called = TextOf(effect, "called");
    return effect.spec->card.name + (called.empty() ? "" : "#" + called);
}

// "dead_zone", and "dead_zone#2" for the second of its kind.
std::string InstanceName(const std::vector<EffectInstance> &effects, size_t index)
{
    const std::string name = KindName(effects[index]);
    int count = 1;
    for (size_t i = 0; i < index; ++i)
        count += KindName(effects[i]) == name;
    return count == 1 ? name : name + "#" + std::to_string(count);
}

// The numbers of a formula, as its author calls them.
void TakeOwnNumbers(EffectInstance &effect)
{
    const std::vector<OwnNumber> own =
        OwnNumbers(TextOf(effect, "numbers"), effect.parameters.size());
    if (own.empty())
        return;
    effect.parameters.resize(own.size());
    for (size_t i = 0; i < own.size(); ++i)
    {
        effect.parameters[i].name = own[i].name;
        effect.parameters[i].unit = own[i].unit;
        effect.parameters[i].doc = own[i].name + " of the formula";
    }
}

constexpr double kSpeedPrior_mps = 0.15;  // of a speed of the duty table
constexpr std::string_view kTable = "base.wheel_speed_mps.";

// Speed `i` of the duty table.
Parameter TableSpeed(const Model &model, size_t i)
{
    Parameter p;
    p.name = std::string(kTable) + std::to_string(i);
    p.unit = "m/s";
    p.value = p.neutral = p.default_value = model.base.wheel_speed_mps[i];
    p.max = 10;
    p.usual_size = kSpeedPrior_mps;
    p.stage = "wheel";
    std::ostringstream doc;
    doc << "speed at " << model.base.duty_pct[i] << " % duty";
    p.doc = doc.str();
    return p;
}

// "a, b or c".
std::string Listed(const std::vector<const char *> &words)
{
    std::string text;
    for (size_t i = 0; i < words.size(); ++i)
        text += std::string(i == 0 ? "" : i + 1 < words.size() ? ", " : " or ") + words[i];
    return text;
}

// Calls visit(parameter, value) for the numbers of the model whose full name is `name`, or for all
// if it is empty; `parameter` has its full name.
template <class Visit>
void ForEach(Model &model, std::string_view name, Visit visit)
{
    for (const Field &field : Fields())
        if (name.empty() || field.Is(name))
            visit(field.In(model), field.at(model));
    if (name.empty() || name.starts_with(kTable))
        for (size_t i = 1; i < model.base.wheel_speed_mps.size();
             ++i)  // speed 0 at duty 0 is fixed
            if (name.empty() || name.substr(kTable.size()) == std::to_string(i))
                visit(TableSpeed(model, i), model.base.wheel_speed_mps[i]);
    for (size_t i = 0; i < model.effects.size(); ++i)
    {
        const std::string prefix = InstanceName(model.effects, i) + ".";
        if (!name.empty() && !name.starts_with(prefix))
            continue;
        for (Parameter &own : model.effects[i].parameters)
        {
            if (!name.empty() && name.substr(prefix.size()) != own.name)
                continue;
            Parameter p = own;
            p.name = prefix + own.name;
            p.stage = model.effects[i].stage;
            visit(p, own.value);
        }
    }
}

}  // namespace

std::vector<double> EffectInstance::Values() const
{
    std::vector<double> values;
    for (const Parameter &parameter : parameters)
        values.push_back(parameter.value);
    return values;
}

BoundEffect EffectInstance::Bind() const
{
    return BoundEffect(*spec, Values(), texts);
}

std::vector<std::string> Model::Instances() const
{
    std::vector<std::string> names;
    for (size_t i = 0; i < effects.size(); ++i)
        names.push_back(InstanceName(effects, i));
    return names;
}

std::vector<Parameter> Model::Parameters() const
{
    std::vector<Parameter> all;
    Model copy = *this;
    ForEach(copy, "", [&](const Parameter &parameter, double &) { all.push_back(parameter); });
    return all;
}

Parameter Model::Find(const std::string &name) const
{
    std::optional<Parameter> found;
    // Reads alone.
    ForEach(const_cast<Model &>(*this), name,
            [&](const Parameter &parameter, double &) { found = parameter; });
    if (!found || name.empty())
        throw std::invalid_argument("model has no quantity '" + name + "'");
    return *found;
}

double Model::Get(const std::string &name) const
{
    return Find(name).value;
}

double &Model::At(const std::string &name)
{
    double *found = nullptr;
    ForEach(*this, name, [&](const Parameter &, double &own) { found = &own; });
    if (!found || name.empty())
        throw std::invalid_argument("model has no quantity '" + name + "'");
    return *found;
}

void Model::Set(const std::string &name, double value)
{
    Find(name).CheckBounds(value, name);
    At(name) = value;
    stated.insert(name);
}

std::string Model::WhyNot(const EffectSpec &spec) const
{
    const auto drive = static_cast<unsigned>(base.drive);
    if (!(spec.card.drives & drive))
        return "acts on robots that are told " + Listed(DriveNames(spec.card.drives)) +
               ", and this model's is told " + DriveNames(drive).front();
    const bool of_wheels = spec.needs_wheels || std::ranges::any_of(spec.parameters, IsPerWheel);
    if (base.wheels == WheelKind::kNone && of_wheels)
        return "acts on single wheels, and base.wheels of this model is \"none\"";
    return "";
}

void Model::AddEffect(const std::string &name, const std::map<std::string, std::string> &texts)
{
    const EffectSpec *spec = FindEffect(name);
    if (!spec)
        throw std::invalid_argument("there is no effect '" + name +
                                    "'; `twinmill twin effects` lists those there are");
    if (const std::string why = WhyNot(*spec); !why.empty())
        throw std::invalid_argument("effect '" + name + "' " + why);
    EffectInstance instance{spec, ParametersFor(*spec, MakeWheels()), {}, ""};
    size_t used = 0;
    for (const TextParameter &text : spec->texts)
    {
        const auto given = texts.find(text.name);
        used += given != texts.end();
        instance.texts.push_back(given != texts.end() ? given->second : text.default_value);
    }
    if (used != texts.size())
        throw std::invalid_argument("effect '" + name +
                                    "' has no such text; `twinmill twin effects " + name +
                                    "` lists those it has");
    TakeOwnNumbers(instance);
    instance.stage = StageName(instance.Bind().act());
    effects.push_back(std::move(instance));
}

void Model::RemoveEffect(size_t index)
{
    if (index >= effects.size())
        throw std::invalid_argument("model has no effect number " + std::to_string(index));
    effects.erase(effects.begin() + static_cast<std::ptrdiff_t>(index));
}

std::vector<Inert> Model::InertIn(PlantKind plant) const
{
    std::vector<Inert> inert;
    const auto name = [&](const char *number, const std::string &why) {
        const Parameter parameter = Find(number);
        if (States(number) && parameter.value != parameter.default_value)
            inert.push_back({number, why});
    };
    const std::string kind = WheelKindName(base.wheels);
    if (plant == PlantKind::kPlanar)
        name("robot.mass_kg", "the planar plant has no forces: use MuJoCo");
    if (base.wheels == WheelKind::kOmni3)
        name("robot.half_wheelbase_m",
             "the wheels of an omni3 robot lie on a circle of radius robot.half_track_m");
    if (base.wheels == WheelKind::kDifferential && plant == PlantKind::kPlanar)
        name("robot.half_wheelbase_m", "a differential robot turns by its track alone");
    if (base.wheels == WheelKind::kDifferential)
        name("base.sideways_gain", "a differential robot does not move sideways");
    if (base.wheels != WheelKind::kAckermann)
        for (const char *number : {"robot.max_steering_rad", "base.steering_lag_s"})
            name(number, "the wheels of a " + kind + " robot are not steered");
    if (base.drive != Drive::kSteering)
        name("base.steering_per_input_rad", "the robot is not commanded by its steering angle");
    return inert;
}

Model Model::ForRobot(int robot_id) const
{
    Model model = *this;
    const auto found = robot_overrides.find(robot_id);
    if (found == robot_overrides.end())
        return model;
    for (const Field &field : Fields())
    {
        const auto value = found->second.find(field.key);
        if (field.per_robot && value != found->second.end())
            field.at(model) = value->second;
    }
    ForEach(model, "", [&](const Parameter &parameter, double &own) {
        if (const auto value = found->second.find(parameter.name); value != found->second.end())
            own = value->second;
    });
    return model;
}

DetectionModel Model::MakeDetectionModel() const
{
    DetectionModel detection;
    detection.range_m = sensor.range_m;
    detection.cone_rad = sensor.cone_rad;
    detection.target_radius_m = sensor.target_radius_m;
    detection.miss_rate = sensor.false_negative_rate;
    detection.false_rate = sensor.false_positive_rate;
    detection.delay_s = sensor.delay_s;
    detection.vote_frames = sensor.vote_frames;
    for (const EffectInstance &effect : effects)
        effect.Bind().Set(detection);
    return detection;
}

Body Model::MakeBody() const
{
    Body body{robot.body_radius_m, 0};
    for (const EffectInstance &effect : effects)
        effect.Bind().Set(body);
    return body;
}

}  // namespace twin

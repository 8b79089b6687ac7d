// SPDX-License-Identifier: Apache-2.0
// Names, values and per-robot copies of a model; parse.cpp reads the file.
#include "model_file/model.h"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include "fields.h"

namespace twin
{
namespace
{

std::string FieldName(const Field &field)
{
    return *field.section ? std::string(field.section) + "." + field.key : field.key;
}

// "dead_zone", and "dead_zone#2" for the second of its kind.
std::string InstanceName(const std::vector<EffectInstance> &effects, size_t index)
{
    const std::string name = effects[index].spec->card.name;
    int count = 1;
    for (size_t i = 0; i < index; ++i)
        count += effects[i].spec == effects[index].spec;
    return count == 1 ? name : name + "#" + std::to_string(count);
}

struct Slot
{
    double *value;
    double min, max;
    std::string unit;
};

// Calls visit(name, slot) for every quantity of the model.
template <class Visit>
void ForEach(Model &model, Visit visit)
{
    for (const Field &field : Fields())
        visit(FieldName(field), Slot{&field.at(model), field.min, field.max, field.unit});
    for (size_t i = 1; i < model.base.wheel_speed_mps.size(); ++i)  // speed 0 at duty 0 is fixed
        visit("base.wheel_speed_mps." + std::to_string(i),
              Slot{&model.base.wheel_speed_mps[i], 0, 10, "m/s"});
    for (size_t i = 0; i < model.effects.size(); ++i)
    {
        const std::string prefix = InstanceName(model.effects, i) + ".";
        auto &effect = model.effects[i];
        for (size_t k = 0; k < effect.values.size(); ++k)
        {
            const Parameter &p = effect.spec->parameters[k];
            const Bounds &bounds = effect.bounds[k];
            visit(prefix + p.name, Slot{&effect.values[k], bounds.min, bounds.max, p.unit});
        }
    }
}

}  // namespace

std::unique_ptr<Effect> EffectInstance::Make() const
{
    return texts.empty() ? spec->make(values) : spec->make_with_texts(values, texts);
}

std::vector<NamedValue> Model::Values() const
{
    std::vector<NamedValue> values;
    Model copy = *this;
    ForEach(copy, [&](const std::string &name, const Slot &slot) {
        values.push_back({name, slot.unit, *slot.value, slot.min, slot.max});
    });
    return values;
}

double Model::Get(const std::string &name) const
{
    for (const NamedValue &value : Values())
        if (value.name == name)
            return value.value;
    throw std::invalid_argument("model has no quantity '" + name + "'");
}

void Model::Set(const std::string &name, double value)
{
    bool found = false;
    ForEach(*this, [&](const std::string &other, const Slot &slot) {
        if (other != name)
            return;
        found = true;
        if (!(value >= slot.min && value <= slot.max))
        {
            std::ostringstream text;
            const std::string tail = slot.unit == "1" ? "" : " " + slot.unit;
            text << name << " = " << value << tail << " is outside " << slot.min << " to "
                 << slot.max << tail;
            throw std::invalid_argument(text.str());
        }
        *slot.value = value;
    });
    if (!found)
        throw std::invalid_argument("model has no quantity '" + name + "'");
}

void Model::AddEffect(const std::string &name, const std::map<std::string, std::string> &texts)
{
    const EffectSpec *spec = FindEffect(name);
    if (!spec)
        throw std::invalid_argument("there is no effect '" + name +
                                    "'; `twinmill effects` lists those there are");
    if (!(spec->card.drives & static_cast<unsigned>(base.drive)))
        throw std::invalid_argument("effect '" + name +
                                    "' acts on wheel duties, and this model's " +
                                    "robot is not driven by duties");
    EffectInstance instance{spec, {}, {}, {}};
    for (const Parameter &parameter : spec->parameters)
    {
        instance.values.push_back(parameter.neutral);
        instance.bounds.push_back({parameter.min, parameter.max});
    }
    size_t used = 0;
    for (const TextParameter &text : spec->texts)
    {
        const auto given = texts.find(text.name);
        used += given != texts.end();
        instance.texts.push_back(given != texts.end() ? given->second : text.default_value);
    }
    if (used != texts.size())
        throw std::invalid_argument("effect '" + name + "' has no such text; `twinmill effects " +
                                    name + "` lists those it has");
    instance.Make();
    effects.push_back(instance);
}

void Model::RemoveEffect(size_t index)
{
    if (index >= effects.size())
        throw std::invalid_argument("model has no effect number " + std::to_string(index));
    effects.erase(effects.begin() + static_cast<std::ptrdiff_t>(index));
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
    ForEach(model, [&](const std::string &name, const Slot &slot) {
        if (const auto value = found->second.find(name); value != found->second.end())
            *slot.value = value->second;
    });
    return model;
}

Sight Model::MakeSight() const
{
    Sight sight;
    sight.range_m = sensor.range_m;
    sight.cone_rad = sensor.cone_rad;
    sight.target_radius_m = sensor.target_radius_m;
    sight.miss_rate = sensor.false_negative_rate;
    sight.false_rate = sensor.false_positive_rate;
    sight.delay_s = sensor.delay_s;
    sight.vote_frames = sensor.vote_frames;
    for (const EffectInstance &effect : effects)
        effect.Make()->Look(sight);
    return sight;
}

Body Model::MakeBody() const
{
    Body body{robot.body_radius_m, 0};
    for (const EffectInstance &effect : effects)
        effect.Make()->Touch(body);
    return body;
}

}  // namespace twin

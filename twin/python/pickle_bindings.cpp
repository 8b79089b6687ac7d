// SPDX-License-Identifier: Apache-2.0
// Models as plain Python values, and back: for pickle.
#include <nanobind/stl/map.h>
#include <nanobind/stl/set.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "pickle_bindings.h"

namespace twin
{
namespace
{

using ByName = std::map<std::string, double>;
using TextsByName = std::map<std::string, std::string>;
using ByRobot = std::map<int, ByName>;
using Names = std::set<std::string, std::less<>>;
using Row = std::vector<double>;

}  // namespace

nb::tuple StateOf(const Model &model)
{
    ByName numbers;
    for (const Parameter &p : model.Parameters())
        numbers[p.name] = p.value;
    nb::list effects;
    for (const EffectInstance &effect : model.effects)
    {
        TextsByName texts;
        for (size_t i = 0; i < effect.texts.size(); ++i)
            texts[effect.spec->texts[i].name] = effect.texts[i];
        effects.append(nb::make_tuple(effect.spec->card.name, texts));
    }
    const Base &base = model.base;
    return nb::make_tuple(static_cast<int>(base.drive), static_cast<int>(base.wheels),
                          base.duty_pct, base.wheel_speed_mps, effects, numbers, model.clock.known,
                          model.clock.same, model.robot_overrides, model.stated);
}

Model ModelOf(const nb::tuple &state)
{
    Model model;
    model.base.drive = static_cast<Drive>(nb::cast<int>(state[0]));
    model.base.wheels = static_cast<WheelKind>(nb::cast<int>(state[1]));
    model.base.duty_pct = nb::cast<Row>(state[2]);
    model.base.wheel_speed_mps = nb::cast<Row>(state[3]);
    for (nb::handle effect : nb::cast<nb::list>(state[4]))
        model.AddEffect(nb::cast<std::string>(effect[0]), nb::cast<TextsByName>(effect[1]));
    for (const auto &[name, value] : nb::cast<ByName>(state[5]))
        model.At(name) = value;
    model.clock.known = nb::cast<bool>(state[6]);
    model.clock.same = nb::cast<bool>(state[7]);
    model.robot_overrides = nb::cast<ByRobot>(state[8]);
    model.stated = nb::cast<Names>(state[9]);
    return model;
}

}  // namespace twin

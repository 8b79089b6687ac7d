// SPDX-License-Identifier: Apache-2.0
// Reads and checks model files.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <stdexcept>

#include <toml++/toml.h>

#include "fields.h"
#include "model_file/model.h"

namespace twin
{
namespace
{

// Thrown with one sentence: file, place, value, why, what to do.
[[noreturn]] void Fail(const std::string &origin, const std::string &sentence)
{
    throw std::invalid_argument(origin + ": " + sentence);
}

// Number of single-letter edits that turn a into b (Levenshtein 1966).
size_t EditDistance(std::string_view a, std::string_view b)
{
    std::vector<size_t> row(b.size() + 1);
    for (size_t j = 0; j <= b.size(); ++j)
        row[j] = j;
    for (size_t i = 1; i <= a.size(); ++i)
    {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= b.size(); ++j)
        {
            const size_t substituted = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            row[j] = std::min({substituted, row[j] + 1, row[j - 1] + 1});
        }
    }
    return row[b.size()];
}

[[noreturn]] void FailUnknown(const std::string &origin, const std::string &where,
                              std::string_view key, const std::set<std::string> &known)
{
    std::string nearest;
    for (const std::string &name : known)
        if (nearest.empty() || EditDistance(key, name) < EditDistance(key, nearest))
            nearest = name;
    Fail(origin, "unknown key '" + std::string(key) + "' in " + where + "; the nearest known is '" +
                     nearest + "'");
}

double Number(const std::string &origin, const std::string &name, const toml::node &node,
              double min, double max, const std::string &unit)
{
    const auto value = node.value<double>();
    if (!value)
        Fail(origin, name + " must be a number in " + unit);
    if (!(*value >= min && *value <= max))
    {
        std::ostringstream text;
        text << name << " = " << *value << " " << unit << " is outside " << min << " to " << max
             << " " << unit;
        Fail(origin, text.str());
    }
    return *value;
}

class Reader
{
public:
    Reader(const toml::table &root, const std::string &origin) : root_(root), origin_(origin) {}

    Model Read()
    {
        CheckSections();
        ReadBase();
        ReadFields();
        ReadRobots();
        ReadEffects();
        model_.clock.known = root_.contains("clock");
        return model_;
    }

private:
    void CheckSections()
    {
        std::set<std::string> known{"name",   "description", "parent", "created_by",
                                    "robots", "effect",      "fit"};
        for (const Field &field : Fields())
            if (*field.section)
                known.insert(field.section);
        for (const auto &[key, node] : root_)
            if (!known.contains(std::string(key.str())))
                FailUnknown(origin_, "the model", key.str(), known);
    }

    // The plain numbers, and a sub-table `std` with their uncertainties, which only people read.
    void ReadFields()
    {
        static const std::set<std::string> kSpecial{"base.drive", "base.wheels", "base.duty_pct",
                                                    "base.wheel_speed_mps"};
        for (const auto &[section, node] : root_)
        {
            const std::string name(section.str());
            const toml::table *table = node.as_table();
            if (!table || name == "robots" || name == "fit")
                continue;
            std::set<std::string> known{"std"};
            for (const Field &field : Fields())
                if (name == field.section)
                    known.insert(field.key);
            for (const auto &[key, value] : *table)
            {
                const std::string path = name + "." + std::string(key.str());
                if (kSpecial.contains(path) || key == "std")
                    continue;
                if (!known.contains(std::string(key.str())))
                    FailUnknown(origin_, "[" + name + "]", key.str(), known);
                for (const Field &field : Fields())
                    if (name == field.section && key.str() == field.key)
                        field.at(model_) =
                            Number(origin_, path, value, field.min, field.max, field.unit);
            }
        }
    }

    template <class Kind>
    void ReadChoice(const char *key, Kind &kind,
                    const std::vector<std::pair<std::string, Kind>> &choices)
    {
        const auto node = root_["base"][key];
        if (!node)
            return;
        const std::string value = node.value_or(std::string());
        std::string words;
        for (const auto &[word, choice] : choices)
        {
            words += (words.empty() ? "" : ", ") + word;
            if (word == value)
            {
                kind = choice;
                return;
            }
        }
        Fail(origin_, std::string("base.") + key + " = '" + value + "' must be one of " + words);
    }

    std::vector<double> ReadList(const char *key, std::vector<double> fallback)
    {
        const auto node = root_["base"][key];
        if (!node)
            return fallback;
        const toml::array *array = node.as_array();
        if (!array)
            Fail(origin_, std::string("base.") + key + " must be a list of numbers");
        std::vector<double> values;
        for (const auto &item : *array)
            values.push_back(
                Number(origin_, std::string("base.") + key, item, -1000, 1000, "its unit"));
        return values;
    }

    void ReadBase()
    {
        Base &base = model_.base;
        ReadChoice<Drive>("drive", base.drive,
                          {{"duty", Drive::kDuty},
                           {"wheel_speed", Drive::kWheelSpeed},
                           {"twist", Drive::kTwist}});
        ReadChoice<WheelKind>("wheels", base.wheels,
                              {{"mecanum", WheelKind::kMecanum},
                               {"differential", WheelKind::kDifferential},
                               {"omni3", WheelKind::kOmni3},
                               {"none", WheelKind::kNone}});
        base.duty_pct = ReadList("duty_pct", base.duty_pct);
        base.wheel_speed_mps = ReadList("wheel_speed_mps", base.wheel_speed_mps);
        const auto &duty = base.duty_pct;
        const bool ascending =
            std::adjacent_find(duty.begin(), duty.end(), std::greater_equal<>()) == duty.end();
        if (duty.size() < 2 || duty.size() != base.wheel_speed_mps.size() || !ascending ||
            duty[0] != 0 || duty.back() < 100)
            Fail(origin_,
                 "base.duty_pct and base.wheel_speed_mps must be lists of the same length, duties "
                 "ascending from 0 to 100 percent");
    }

    void ReadRobots()
    {
        const toml::table *robots = root_["robots"].as_table();
        if (!robots)
            return;
        std::set<std::string> known;
        for (const Field &field : Fields())
            if (field.per_robot)
                known.insert(field.key);
        for (const auto &[name, node] : *robots)
        {
            int id = -1;
            const std::string text(name.str());
            if (text.size() != 3 || std::sscanf(text.c_str(), "R%2d", &id) != 1 || id < 0 ||
                !node.is_table())
                Fail(origin_, "[robots." + text + "] must be named R00 to R99");
            for (const auto &[key, value] : *node.as_table())
            {
                const std::string word(key.str());
                if (!known.contains(word))
                    FailUnknown(origin_, "[robots." + text + "]", word, known);
                for (const Field &field : Fields())
                    if (field.per_robot && word == field.key)
                        model_.robot_overrides[id][word] =
                            Number(origin_, "robots." + text + "." + word, value, field.min,
                                   field.max, field.unit);
            }
        }
    }

    void ReadEffects()
    {
        const toml::array *list = root_["effect"].as_array();
        if (!list)
            return;
        for (const auto &item : *list)
        {
            const toml::table *table = item.as_table();
            const std::string name = table ? (*table)["name"].value_or(std::string()) : "";
            const EffectSpec *spec = FindEffect(name);
            if (!spec)
            {
                std::set<std::string> known;
                for (const EffectSpec *other : Catalogue())
                    known.insert(other->card.name);
                FailUnknown(origin_, "[[effect]] name", name, known);
            }
            try
            {
                model_.AddEffect(name);
            }
            catch (const std::invalid_argument &error)
            {
                Fail(origin_, error.what());
            }
            ReadEffectValues(*table, *spec);
        }
    }

    void ReadEffectValues(const toml::table &table, const EffectSpec &spec)
    {
        std::set<std::string> known{"name", "std", "fitted_on", "error_before", "error_after"};
        auto &values = model_.effects.back().values;
        for (size_t i = 0; i < spec.parameters.size(); ++i)
        {
            const Parameter &p = spec.parameters[i];
            known.insert(p.name);
            const toml::node *node = table.get(p.name);
            values[i] = node ? Number(origin_, std::string(spec.card.name) + "." + p.name, *node,
                                      p.min, p.max, p.unit)
                             : p.default_value;
        }
        for (const auto &[key, value] : table)
            if (!known.contains(std::string(key.str())))
                FailUnknown(origin_, "effect '" + std::string(spec.card.name) + "'", key.str(),
                            known);
    }

    const toml::table &root_;
    const std::string &origin_;
    Model model_;
};

}  // namespace

Model Model::FromToml(std::string_view text, const std::string &origin)
{
    toml::table root;
    try
    {
        root = toml::parse(text, origin);
    }
    catch (const toml::parse_error &error)
    {
        const auto where = error.source().begin;
        Fail(origin, "is no valid TOML: " + std::string(error.description()) + " (line " +
                         std::to_string(where.line) + ", column " + std::to_string(where.column) +
                         ")");
    }
    return Reader(root, origin).Read();
}

Model Model::Load(const std::string &name)
{
    const std::string path = FindModelFile(name);
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    if (!file)
        Fail(path, "cannot be read");
    return FromToml(text.str(), path);
}

std::string FindModelFile(const std::string &name)
{
    namespace fs = std::filesystem;
    if (fs::is_regular_file(name))
        return name;
    const char *from_environment = std::getenv("TWINMILL_MODELS");
    const fs::path installed = from_environment ? from_environment : TWINMILL_MODELS_DIR;
    std::string others;
    for (const auto &entry : fs::recursive_directory_iterator(installed))
    {
        if (entry.path().extension() != fs::path(name).extension())
            continue;
        if (entry.path().filename() == name)
            return entry.path().string();
        others += (others.empty() ? "" : ", ") + entry.path().filename().string();
    }
    Fail(name, "no such file here, nor among the installed models (" + others + ")");
}

}  // namespace twin

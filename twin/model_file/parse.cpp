// SPDX-License-Identifier: Apache-2.0
// Reads and checks model files.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <stdexcept>

#include <toml++/toml.h>

#include "effects/nearest.h"
#include "effects/own_numbers.h"
#include "fields.h"
#include "model_file/installed.h"
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

// `what` is "key" or the like, `where` the table that holds it.
[[noreturn]] void FailUnknown(const std::string &origin, const std::string &what,
                              std::string_view name, const std::string &where,
                              const std::set<std::string> &known)
{
    Fail(origin, "unknown " + what + " " + Quoted(name) + " in " + where + "; " +
                     NearestKnown(name, known));
}

double Number(const std::string &origin, const std::string &name, const toml::node &node,
              double min, double max, const std::string &unit)
{
    const auto value = node.value<double>();
    const std::string tail = unit == "1" ? "" : " " + unit;
    std::ostringstream text;
    text << name;
    if (!value)
        text << " must be a number from ";
    else if (!(*value >= min && *value <= max))
        text << " = " << *value << tail << " is outside ";
    else
        return *value;
    text << min << " to " << max << tail;
    Fail(origin, text.str());
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
        ReadEffects();
        ReadRobots();
        ReadBits();
        ReadClock();
        return model_;
    }

private:
    // Every top-level name is known and of the right kind: a text, [table] or [[effect]] list.
    void CheckSections()
    {
        const std::set<std::string> texts{"name", "description", "parent", "created_by"};
        std::set<std::string> tables{"robots", "fit"};
        for (const Field &field : Fields())
            if (*field.section)
                tables.insert(field.section);
        std::set<std::string> known{"effect"};
        known.insert(texts.begin(), texts.end());
        known.insert(tables.begin(), tables.end());
        for (const auto &[key, node] : root_)
        {
            const std::string name(key.str());
            if (!known.contains(name))
                FailUnknown(origin_, "key", name, "the model", known);
            if (tables.contains(name) && !node.is_table())
                Fail(origin_, "'" + name + "' must be a table: [" + name + "]");
            if (name == "effect" && !node.is_array_of_tables())
                Fail(origin_, "'effect' must be a list of tables: [[effect]]");
        }
    }

    // The plain numbers, and a sub-table `std` with their uncertainties, which only people read.
    void ReadFields()
    {
        static const std::set<std::string> kSpecial{"base.drive",    "base.wheels",
                                                    "base.duty_pct", "base.wheel_speed_mps",
                                                    "clock.same",    "sensor.bits"};
        for (const auto &[section, node] : root_)
        {
            const std::string name(section.str());
            const toml::table *table = node.as_table();
            if (!table || name == "robots" || name == "fit")
                continue;
            std::set<std::string> known{"std", "fitted_on"};
            if (name == "clock")
                known.insert("same");
            if (name == "sensor")
                known.insert("bits");
            for (const Field &field : Fields())
                if (name == field.section)
                    known.insert(field.key);
            for (const auto &[key, value] : *table)
            {
                const std::string path = name + "." + std::string(key.str());
                if (kSpecial.contains(path) || key == "std" || key == "fitted_on")
                    continue;
                if (!known.contains(std::string(key.str())))
                    FailUnknown(origin_, "key", key.str(), "[" + name + "]", known);
                for (const Field &field : Fields())
                    if (name == field.section && key.str() == field.key)
                    {
                        field.at(model_) =
                            Number(origin_, path, value, field.min, field.max, field.unit);
                        model_.stated.insert(path);
                    }
            }
        }
    }

    // Texts for the firmware, which says what they may be.
    void ReadBits()
    {
        const toml::node_view bits = root_["sensor"]["bits"];
        if (!bits)
            return;
        const toml::array *texts = bits.as_array();
        if (!texts || texts->empty() || !texts->is_homogeneous<std::string>())
            Fail(origin_, "sensor.bits must be a list of texts, as in [\"left\", \"right\"]");
        model_.sensor.bits.clear();
        for (const toml::node &text : *texts)
            model_.sensor.bits.push_back(*text.value<std::string>());
    }

    // `same = true`: poses and commands were stamped by one clock, so nothing is to be estimated.
    void ReadClock()
    {
        Clock &clock = model_.clock;
        clock.known = root_.contains("clock");
        const toml::node_view same = root_["clock"]["same"];
        if (same && !same.is_boolean())
            Fail(origin_, "clock.same must be true or false");
        clock.same = same.value_or(false);
        if (clock.same && (clock.offset_s != 0 || clock.rate_ppm != 0))
            Fail(origin_,
                 "clock.same = true says that one clock stamped poses and commands, but "
                 "clock.offset_s or clock.rate_ppm is not 0; remove the one or the other");
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

    std::vector<double> ReadList(const char *key, double max, const char *unit,
                                 std::vector<double> fallback)
    {
        const auto node = root_["base"][key];
        if (!node)
            return fallback;
        const toml::array *array = node.as_array();
        if (!array)
            Fail(origin_, std::string("base.") + key + " must be a list of numbers");
        std::vector<double> values;
        for (const auto &item : *array)
            values.push_back(Number(origin_, std::string("base.") + key, item, 0, max, unit));
        return values;
    }

    void ReadBase()
    {
        Base &base = model_.base;
        ReadChoice<Drive>("drive", base.drive,
                          {{"duty", Drive::kDuty},
                           {"wheel_speed", Drive::kWheelSpeed},
                           {"twist", Drive::kTwist},
                           {"steering", Drive::kSteering}});
        ReadChoice<WheelKind>("wheels", base.wheels,
                              {{"mecanum", WheelKind::kMecanum},
                               {"differential", WheelKind::kDifferential},
                               {"omni3", WheelKind::kOmni3},
                               {"ackermann", WheelKind::kAckermann},
                               {"none", WheelKind::kNone}});
        const bool steers = base.wheels == WheelKind::kAckermann;
        if (steers && base.drive != Drive::kTwist && base.drive != Drive::kSteering)
            Fail(
                origin_,
                "base.wheels = 'ackermann' needs base.drive = 'twist' or 'steering': wheels do not "
                "say where a robot steers");
        if (!steers && base.drive == Drive::kSteering)
            Fail(origin_, "base.drive = 'steering' needs base.wheels = 'ackermann'");
        base.duty_pct = ReadList("duty_pct", 100, "%", base.duty_pct);
        base.wheel_speed_mps = ReadList("wheel_speed_mps", 10, "m/s", base.wheel_speed_mps);
        const auto &duty = base.duty_pct;
        const bool ascending =
            std::adjacent_find(duty.begin(), duty.end(), std::greater_equal<>()) == duty.end();
        if (duty.size() < 2 || duty.size() != base.wheel_speed_mps.size() || !ascending ||
            duty[0] != 0 || duty.back() != 100 || base.wheel_speed_mps[0] != 0)
            Fail(origin_,
                 "base.duty_pct and base.wheel_speed_mps must be lists of the same length, duties "
                 "ascending from 0 to 100 percent, the first speed 0");
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
            const std::string text(name.str());
            const auto digit = [&text](size_t i) { return text[i] >= '0' && text[i] <= '9'; };
            if (text.size() != 3 || text[0] != 'R' || !digit(1) || !digit(2) || !node.is_table())
                Fail(origin_, "[robots." + text + "] must be a table named R00 to R99");
            const int id = 10 * (text[1] - '0') + (text[2] - '0');
            for (const auto &[key, value] : *node.as_table())
            {
                const std::string word(key.str());
                if (value.is_table())
                {
                    ReadRobotEffect(id, text, word, *value.as_table());
                    continue;
                }
                if (!known.contains(word))
                    FailUnknown(origin_, "key", word, "[robots." + text + "]", known);
                for (const Field &field : Fields())
                    if (field.per_robot && word == field.key)
                        model_.robot_overrides[id][word] =
                            Number(origin_, "robots." + text + "." + word, value, field.min,
                                   field.max, field.unit);
            }
        }
    }

    // `wheel_gain.fl = 0.9` of one robot; the effect stands among the model's own.
    void ReadRobotEffect(int id, const std::string &robot, const std::string &effect,
                         const toml::table &table)
    {
        const std::string where = "[robots." + robot + "]";
        std::map<std::string, Parameter> known;
        for (const Parameter &quantity : model_.Parameters())
            if (FindEffect(effect.substr(0, effect.find('#'))) &&
                quantity.name.starts_with(effect + "."))
                known[quantity.name.substr(effect.size() + 1)] = quantity;
        std::set<std::string> keys;
        for (const auto &[key, quantity] : known)
            keys.insert(key);
        if (keys.empty())
            Fail(origin_, "effect '" + effect + "' in " + where +
                              " is not among the model's: give it an [[effect]] of its own, with "
                              "the values of the other robots");
        CheckKeys(table, keys, "effect '" + effect + "' of " + where);
        for (const auto &[key, value] : table)
        {
            const Parameter &quantity = known[std::string(key.str())];
            model_.robot_overrides[id][quantity.name] =
                Number(origin_, "robots." + robot + "." + quantity.name, value, quantity.min,
                       quantity.max, quantity.unit);
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
            const std::string name = (*table)["name"].value_or(std::string());
            if (name.empty())
                Fail(origin_, "[[effect]] number " + std::to_string(model_.effects.size() + 1) +
                                  " needs a name = \"...\"");
            const EffectSpec *spec = FindEffect(name);
            if (!spec)
            {
                std::set<std::string> known;
                for (const EffectSpec *other : Catalogue())
                    known.insert(other->card.name);
                FailUnknown(origin_, "effect", name, "[[effect]]", known);
            }
            const std::map<std::string, std::string> texts = ReadTexts(*table, *spec);
            try
            {
                model_.AddEffect(name, texts);
            }
            catch (const std::invalid_argument &error)
            {
                Fail(origin_, error.what());
            }
            ReadEffectValues(*table, *spec);
        }
    }

    std::map<std::string, std::string> ReadTexts(const toml::table &table, const EffectSpec &spec)
    {
        std::map<std::string, std::string> texts;
        for (const TextParameter &text : spec.texts)
        {
            const toml::node *node = table.get(text.name);
            if (node && !node->is_string())
                Fail(origin_, std::string(spec.card.name) + "." + text.name + " must be a text");
            if (node)
                texts[text.name] = node->value_or(std::string());
        }
        return texts;
    }

    void ReadEffectValues(const toml::table &table, const EffectSpec &spec)
    {
        std::set<std::string> known(std::begin(kEffectKeys), std::end(kEffectKeys));
        for (const TextParameter &text : spec.texts)
            known.insert(text.name);
        std::set<std::string> parameters;
        for (Parameter &p : model_.effects.back().parameters)
        {
            const std::string name = std::string(spec.card.name) + "." + p.name;
            parameters.insert(p.name);
            ReadBounds(table, name, p);
            const toml::node *node = table.get(p.name);
            p.value = node ? Number(origin_, name, *node, p.min, p.max, p.unit)
                           : std::clamp(p.default_value, p.min, p.max);
        }
        known.insert(parameters.begin(), parameters.end());
        CheckKeys(table, known, "effect '" + std::string(spec.card.name) + "'");
        if (const toml::table *bounds = table["bounds"].as_table())
            CheckKeys(*bounds, parameters, "bounds of '" + std::string(spec.card.name) + "'");
    }

    void CheckKeys(const toml::table &table, const std::set<std::string> &known,
                   const std::string &where)
    {
        for (const auto &[key, value] : table)
            if (!known.contains(std::string(key.str())))
                FailUnknown(origin_, "key", key.str(), where, known);
    }

    // Of one parameter: `bounds = { width = [0, 0.2] }` narrows its own.
    void ReadBounds(const toml::table &table, const std::string &name, Parameter &p)
    {
        const toml::node *node = table.get("bounds");
        const toml::table *all = node ? node->as_table() : nullptr;
        const toml::node *pair = all ? all->get(p.name) : nullptr;
        if (node && !all)
            Fail(origin_, name + ": 'bounds' must be a table such as { " + p.name + " = [0, 1] }");
        if (!pair)
            return;
        const toml::array *ends = pair->as_array();
        if (!ends || ends->size() != 2)
            Fail(origin_, name + ": its bounds must be two numbers, [min, max]");
        p.min = Number(origin_, "lower bound of " + name, *ends->get(0), p.min, p.max, p.unit);
        p.max = Number(origin_, "upper bound of " + name, *ends->get(1), p.min, p.max, p.unit);
    }

    const toml::table &root_;
    const std::string &origin_;
    Model model_;
};

std::filesystem::path InstalledModels()
{
    if (const char *from_environment = std::getenv("TWINMILL_MODELS"))
        return from_environment;
    return std::filesystem::is_directory(TWINMILL_MODELS_DIR) ? TWINMILL_MODELS_DIR
                                                              : TWINMILL_INSTALLED_MODELS_DIR;
}

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

std::optional<std::string> FindInstalledModelFile(const std::string &file)
{
    std::error_code unreadable;
    for (const auto &entry :
         std::filesystem::recursive_directory_iterator(InstalledModels(), unreadable))
        if (entry.is_regular_file(unreadable) && entry.path().filename() == file)
            return entry.path().lexically_normal().string();
    return std::nullopt;
}

std::string FindModelFile(const std::string &name)
{
    namespace fs = std::filesystem;
    const bool is_whole = fs::path(name).has_extension();
    const std::string file = is_whole ? name : name + ".toml";
    const fs::path kind = is_whole ? fs::path(name).extension() : ".toml";
    std::error_code unreadable;
    for (const std::string &here : {name, file})
        if (fs::is_regular_file(here, unreadable))
            return here;
    if (const auto found = FindInstalledModelFile(file))
        return *found;
    std::set<std::string> others;
    for (const auto &entry : fs::recursive_directory_iterator(InstalledModels(), unreadable))
        if (entry.is_regular_file(unreadable) && entry.path().extension() == kind)
            others.insert(entry.path().filename().string());
    std::string list;
    for (const std::string &other : others)
        list += (list.empty() ? "" : ", ") + other;
    Fail(name,
         "no such file here, nor among the installed models (" +
             (list.empty() ? "none in " + InstalledModels().lexically_normal().string() : list) +
             ")");
}

}  // namespace twin

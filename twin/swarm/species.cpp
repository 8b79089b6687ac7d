// SPDX-License-Identifier: Apache-2.0
#include "swarm/species.h"

#include <algorithm>
#include <charconv>
#include <sstream>
#include <stdexcept>

#include "plant/plant.h"

namespace twin
{
namespace
{

constexpr size_t kNamesShown = 10;

const fw_behavior &MustFind(const std::string &name, std::span<const fw_behavior> own)
{
    if (const fw_behavior *found = FindBehavior(name, own))
        return *found;
    std::string known;
    for (size_t i = 0; i < fw_behavior_count(); ++i)
        known += (i ? ", " : "") + std::string(fw_behavior_at(i)->name);
    std::string more;
    for (const fw_behavior &behavior : own.first(std::min(own.size(), kNamesShown)))
        more += std::string(", ") + behavior.name;
    if (own.size() > kNamesShown)
        more += " and " + std::to_string(own.size() - kNamesShown) + " more";
    throw std::invalid_argument("--behavior: there is no behaviour '" + name +
                                "'; the firmware has " + known +
                                (own.empty() ? "" : "; your own are " + more.substr(2)));
}

int ParseCount(const std::string &part, const std::string &digits)
{
    int count = 0;
    const char *end = digits.data() + digits.size();
    const auto [stop, error] = std::from_chars(digits.data(), end, count);
    if (error != std::errc() || stop != end || count < 1 || count > kMaxRobots)
        throw std::invalid_argument("--behavior: '" + part +
                                    "' must be name:count with a count of 1 to " +
                                    std::to_string(kMaxRobots));
    return count;
}

// Robots of one name and colour.
struct Part
{
    std::string name, colour;
    size_t count;
};

Part MakePart(const std::string &name, int count)
{
    const size_t at = name.find('@');
    return {name.substr(0, at), at == std::string::npos ? "green" : name.substr(at + 1),
            static_cast<size_t>(count)};
}

std::vector<Part> Split(const std::string &text, std::optional<int> n)
{
    if (text.find(':') == std::string::npos && text.find(',') == std::string::npos)
        return {MakePart(text, n.value_or(6))};
    std::vector<Part> parts;
    size_t robots = 0;
    std::istringstream words(text);
    for (std::string word; std::getline(words, word, ',');)
    {
        const size_t colon = word.find(':');
        const std::string digits = colon == std::string::npos ? "" : word.substr(colon + 1);
        parts.push_back(MakePart(word.substr(0, colon), ParseCount(word, digits)));
        robots += parts.back().count;
    }
    const size_t wanted = n ? static_cast<size_t>(*n) : robots;
    if (robots != wanted || robots > kMaxRobots)
        throw std::invalid_argument("--behavior '" + text + "' is for " + std::to_string(robots) +
                                    " robots, but there are " +
                                    std::to_string(n.value_or(kMaxRobots)) +
                                    (n ? " (--n): make both agree" : " at most"));
    return parts;
}

}  // namespace

const fw_behavior *FindBehavior(const std::string &name, std::span<const fw_behavior> own)
{
    for (const fw_behavior &behavior : own)
        if (name == behavior.name)
            return &behavior;
    return fw_behavior_find(name.c_str());
}

std::string TableText(const fw_table &table)
{
    std::ostringstream text;
    for (int row = 0; row < fw_table_row_count(&table); ++row)
        text << (row ? "," : "") << table.rows[row].speed_input_pct << ","
             << table.rows[row].turn_input_milli / 1000.0;
    return text.str();
}

std::vector<const fw_behavior *> ParseSpecies(const std::string &text, std::optional<int> n,
                                              std::span<const fw_behavior> own)
{
    std::vector<const fw_behavior *> robots;
    for (const Part &part : Split(text, n))
        robots.insert(robots.end(), part.count, &MustFind(part.name, own));
    return robots;
}

std::vector<std::string> ColourNames(const std::string &text, std::optional<int> n)
{
    std::vector<std::string> robots;
    for (const Part &part : Split(text, n))
        robots.insert(robots.end(), part.count, part.colour);
    return robots;
}

std::vector<Colour> ParseColours(const std::string &text, std::optional<int> n)
{
    std::vector<Colour> robots;
    for (const std::string &name : ColourNames(text, n))
        robots.push_back(ColourNamed(name));
    return robots;
}

Ring RingOf(std::span<const fw_behavior *const> robots)
{
    const auto count = [&](const fw_behavior *of) { return std::ranges::count(robots, of); };
    const fw_behavior *usual = *std::ranges::max_element(robots, {}, count);
    Ring ring{{}, static_cast<size_t>(count(usual))};
    for (const bool of_ring : {true, false})
        for (size_t i = 0; i < robots.size(); ++i)
            if ((robots[i] == usual) == of_ring)
                ring.order.push_back(i);
    return ring;
}

}  // namespace twin

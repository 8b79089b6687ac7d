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

}  // namespace

const fw_behavior *FindBehavior(const std::string &name, std::span<const fw_behavior> own)
{
    for (const fw_behavior &behavior : own)
        if (name == behavior.name)
            return &behavior;
    return fw_behavior_find(name.c_str());
}

std::vector<const fw_behavior *> ParseSpecies(const std::string &text, std::optional<int> n,
                                              std::span<const fw_behavior> own)
{
    std::vector<const fw_behavior *> robots;
    if (text.find(':') == std::string::npos && text.find(',') == std::string::npos)
    {
        robots.assign(static_cast<size_t>(n.value_or(6)), &MustFind(text, own));
        return robots;
    }
    std::istringstream parts(text);
    for (std::string part; std::getline(parts, part, ',');)
    {
        const size_t colon = part.find(':');
        const std::string digits = colon == std::string::npos ? "" : part.substr(colon + 1);
        const int count = ParseCount(part, digits);
        robots.insert(robots.end(), static_cast<size_t>(count),
                      &MustFind(part.substr(0, colon), own));
    }
    const size_t wanted = n ? static_cast<size_t>(*n) : robots.size();
    if (robots.size() != wanted || robots.size() > kMaxRobots)
        throw std::invalid_argument("--behavior '" + text + "' is for " +
                                    std::to_string(robots.size()) + " robots, but there are " +
                                    std::to_string(n.value_or(kMaxRobots)) +
                                    (n ? " (--n): make both agree" : " at most"));
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

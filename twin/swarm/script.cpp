// SPDX-License-Identifier: Apache-2.0
#include "swarm/script.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace twin
{
namespace
{

const std::string kInputHeader = "t_s,speed_input,turn_input";
const std::string kDutyHeader = "t_s,fl_pct,fr_pct,rl_pct,rr_pct";

[[noreturn]] void Fail(const std::string &path, size_t line, const std::string &sentence)
{
    throw std::invalid_argument(path + ", line " + std::to_string(line) + ": " + sentence);
}

std::string WithoutReturn(std::string line)
{
    if (!line.empty() && line.back() == '\r')
        line.pop_back();
    return line;
}

std::vector<double> Numbers(const std::string &path, size_t number, const std::string &line)
{
    std::vector<double> values;
    std::istringstream cells(line);
    for (std::string cell; std::getline(cells, cell, ',');)
    {
        double value = 0;
        const char *end = cell.data() + cell.size();
        const auto [stop, error] = std::from_chars(cell.data(), end, value);
        if (error != std::errc() || stop != end || !std::isfinite(value))
            Fail(path, number, "'" + cell + "' is no number");
        values.push_back(value);
    }
    return values;
}

ScriptRow InputRow(const std::string &path, size_t number, const std::vector<double> &v)
{
    if (std::abs(v[1]) > FW_SPEED_INPUT_MAX_PCT || std::abs(v[2]) * 1000 > FW_TURN_INPUT_MAX_MILLI)
        Fail(path, number, "speed_input must be within -100..100 and turn_input within -2..2");
    return {
        v[0],
        {static_cast<int32_t>(std::lround(v[1])), static_cast<int32_t>(std::lround(v[2] * 1000))},
        {}};
}

ScriptRow DutyRow(const std::string &path, size_t number, const std::vector<double> &v)
{
    ScriptRow row{v[0], {}, {}};
    for (size_t k = 0; k < FW_WHEEL_COUNT; ++k)
    {
        if (std::abs(v[1 + k]) > FW_DUTY_MAX_PCT)
            Fail(path, number, "duties must be within -100..100 percent");
        row.wheel_duty_pct[k] = static_cast<int8_t>(std::lround(v[1 + k]));
    }
    return row;
}

}  // namespace

Script Script::Load(const std::string &path)
{
    std::ifstream file(path);
    std::string line;
    if (!file || !std::getline(file, line))
        throw std::invalid_argument(path + ": no such input script, or it is empty");
    line = WithoutReturn(line);
    Script script;
    script.has_duties_ = line == kDutyHeader;
    if (!script.has_duties_ && line != kInputHeader)
        Fail(path, 1, "the header must be " + kInputHeader + " or " + kDutyHeader);
    const size_t columns = script.has_duties_ ? 5 : 3;
    for (size_t number = 2; std::getline(file, line); ++number)
    {
        line = WithoutReturn(line);
        if (line.empty())
            continue;
        const std::vector<double> values = Numbers(path, number, line);
        if (values.size() != columns)
            Fail(path, number,
                 "has " + std::to_string(values.size()) + " columns instead of " +
                     std::to_string(columns));
        if (!script.rows_.empty() && !(values[0] > script.rows_.back().t_s))
            Fail(path, number, "t_s must be later than in the row before");
        script.rows_.push_back(script.has_duties_ ? DutyRow(path, number, values)
                                                  : InputRow(path, number, values));
    }
    if (script.rows_.empty())
        Fail(path, 1, "the script has no rows");
    return script;
}

const ScriptRow *Script::At(double t_s) const
{
    const auto next = std::upper_bound(rows_.begin(), rows_.end(), t_s,
                                       [](double t, const ScriptRow &row) { return t < row.t_s; });
    return next == rows_.begin() ? nullptr : &*std::prev(next);
}

}  // namespace twin

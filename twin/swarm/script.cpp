// SPDX-License-Identifier: Apache-2.0
#include "swarm/script.h"

#include <algorithm>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "fw/script.h"

namespace twin
{
namespace
{

std::string ReadAll(const std::string &path)
{
    std::ostringstream text;
    std::ifstream file(path, std::ios::binary);
    if (!(text << file.rdbuf()))
        throw std::invalid_argument(path + ": no such input script, or it is empty");
    return text.str();
}

}  // namespace

Script Script::Load(const std::string &path)
{
    const std::string text = ReadAll(path);
    std::vector<fw_script_row> rows(
        static_cast<size_t>(std::count(text.begin(), text.end(), '\n')) + 1);
    fw_script parsed{rows.data(), static_cast<int32_t>(rows.size()), 0, false};
    int32_t line = 0;
    const fw_script_fault fault = fw_script_parse(text.data(), text.size(), &parsed, &line);
    if (fault != FW_SCRIPT_OK)
        throw std::invalid_argument(path + ", line " + std::to_string(line) + ": " +
                                    fw_script_fault_str(fault));
    Script script;
    script.has_duties_ = parsed.has_duties;
    rows.resize(static_cast<size_t>(parsed.row_count));
    for (const fw_script_row &row : rows)
    {
        ScriptRow &added = script.rows_.emplace_back();
        added.t_s = static_cast<double>(row.t_us) / 1e6;
        added.input = row.input;
        std::copy_n(row.wheel_duty_pct, added.wheel_duty_pct.size(), added.wheel_duty_pct.begin());
    }
    return script;
}

const ScriptRow *Script::At(double t_s) const
{
    const auto next = std::upper_bound(rows_.begin(), rows_.end(), t_s,
                                       [](double t, const ScriptRow &row) { return t < row.t_s; });
    return next == rows_.begin() ? nullptr : &*std::prev(next);
}

}  // namespace twin

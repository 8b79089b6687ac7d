// SPDX-License-Identifier: Apache-2.0
// An input script: what the wheels are told over time, whatever the sensor sees.
#ifndef SWARM_SCRIPT_H
#define SWARM_SCRIPT_H

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "fw/mixing.h"

namespace twin
{

struct ScriptRow
{
    double t_s;
    fw_input input;                                     // if the script has inputs
    std::array<int8_t, FW_WHEEL_COUNT> wheel_duty_pct;  // if it has duties
};

class Script
{
public:
    // Reads CSV with the header t_s,speed_input,turn_input or t_s,fl_pct,fr_pct,rl_pct,rr_pct.
    // The core parses it, as on the robot: see fw/script.h. Throws std::invalid_argument in one
    // sentence.
    static Script Load(const std::string &path);

    bool has_duties() const { return has_duties_; }
    double EndS() const { return rows_.back().t_s; }
    // The row held at `t_s`; nullptr before the first.
    const ScriptRow *At(double t_s) const;

private:
    bool has_duties_ = false;
    std::vector<ScriptRow> rows_;
};

}  // namespace twin

#endif

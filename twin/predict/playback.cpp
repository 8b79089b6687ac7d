// SPDX-License-Identifier: Apache-2.0
#include "playback.h"

#include <algorithm>
#include <limits>

namespace twin
{

// Steps end at each command and are no longer than this: the ground stage sees the pose at their
// start.
constexpr double kMaxStepS = 0.02;

Command Playback::Held() const
{
    Command command;
    if (next_ == 0)
        return command;
    const size_t i = next_ - 1;
    for (size_t k = 0; k < kWheels; ++k)
        command.value[k] = track_->command[kWheels * i + k];
    command.battery_V = track_->battery_V[i];
    return command;
}

void Playback::Advance(double to_s, RobotState &state, Random *random)
{
    const auto &times = track_->command_t_s;
    while (t_s_ < to_s)
    {
        while (next_ < times.size() && times[next_] <= t_s_)
            ++next_;
        const double change_s =
            next_ < times.size() ? times[next_] : std::numeric_limits<double>::infinity();
        const double end_s = std::min({to_s, change_s, t_s_ + kMaxStepS});
        PlanarStep(*chain_, Held(), t_s_, end_s - t_s_, state, random);
        t_s_ = end_s;
    }
}

}  // namespace twin

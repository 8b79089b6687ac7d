// SPDX-License-Identifier: Apache-2.0
// Plays logged commands into one robot.
#ifndef PREDICT_PLAYBACK_H
#define PREDICT_PLAYBACK_H

#include <algorithm>
#include <limits>

#include "predict/predict.h"

namespace twin
{

class Playback
{
public:
    // Starts at the first command; before it the robot stands still.
    explicit Playback(const Track &track)
        : track_(&track), t_s_(track.command_t_s.empty() ? 0 : track.command_t_s[0])
    {
    }

    // Goes on to time `to_s` (robot's clock) and calls move(command, t_s, dt_s) for each step on
    // the way. Does not run backwards.
    template <class Move>
    void Advance(double to_s, Move move)
    {
        const auto &times = track_->command_t_s;
        while (t_s_ < to_s)
        {
            while (next_ < times.size() && times[next_] <= t_s_)
                ++next_;
            const double change_s =
                next_ < times.size() ? times[next_] : std::numeric_limits<double>::infinity();
            const double end_s = std::min({to_s, change_s, t_s_ + kMaxStepS});
            move(Held(), t_s_, end_s - t_s_);
            t_s_ = end_s;
        }
    }

private:
    // Steps end at each command and are no longer than this, as a swarm's are: the ground stage
    // sees the pose at their start. Commands that come 45 times a second are one step each.
    static constexpr double kMaxStepS = 0.025;

    Command Held() const
    {
        Command command;
        if (next_ == 0)
            return command;
        const size_t i = next_ - 1;
        for (size_t k = 0; k < kMaxWheels; ++k)
            command.value[k] = track_->command[kMaxWheels * i + k];
        command.battery_V = track_->battery_V[i];
        return command;
    }

    const Track *track_;
    double t_s_;
    size_t next_ = 0;  // first command later than t_s_
};

}  // namespace twin

#endif

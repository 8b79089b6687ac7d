// SPDX-License-Identifier: Apache-2.0
// Plays logged commands into one robot.
#ifndef PREDICT_PLAYBACK_H
#define PREDICT_PLAYBACK_H

#include <algorithm>
#include <cstddef>

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
            for (; next_ < times.size() && times[next_] <= t_s_; ++next_)
                if (!Repeats(next_))
                    changed_s_ = times[next_];
            const double most_s = t_s_ - changed_s_ < kSoonS ? kMaxStepS : kMaxSteadyStepS;
            const double end_s = ChangeBefore(std::min(to_s, t_s_ + most_s));
            move(Held(), t_s_, end_s - t_s_);
            t_s_ = end_s;
        }
    }

private:
    // Steps end where a command differs from the one before, and are no longer than a swarm's are:
    // the ground stage sees the pose at their start. What is told again changes nothing.
    static constexpr double kMaxStepS = 0.025;
    // Once the wheels have followed a command there is little that a step could miss.
    static constexpr double kMaxSteadyStepS = 0.05, kSoonS = 0.3;

    bool Repeats(size_t i) const
    {
        const auto told = track_->command.begin() + static_cast<std::ptrdiff_t>(kMaxWheels * i);
        return i > 0 && std::equal(told, told + kMaxWheels, told - kMaxWheels);
    }

    // When the command changes next, but no later than `end_s`.
    double ChangeBefore(double end_s) const
    {
        const auto &times = track_->command_t_s;
        for (size_t i = next_; i < times.size() && times[i] < end_s; ++i)
            if (!Repeats(i))
                return times[i];
        return end_s;
    }

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
    double changed_s_ = t_s_;
    size_t next_ = 0;  // first command later than t_s_
};

}  // namespace twin

#endif

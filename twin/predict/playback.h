// SPDX-License-Identifier: Apache-2.0
// Plays logged commands into one robot.
#ifndef PREDICT_PLAYBACK_H
#define PREDICT_PLAYBACK_H

#include "predict/predict.h"

namespace twin
{

class Playback
{
public:
    // Starts at the first command; before it the robot stands still.
    Playback(const DriveChain &chain, const Track &track)
        : chain_(&chain), track_(&track), t_s_(track.command_t_s.empty() ? 0 : track.command_t_s[0])
    {
    }

    // Moves the robot to time `to_s` (robot's clock), command by command. Does not run backwards.
    void Advance(double to_s, RobotState &state, Random *random);

private:
    Command Held() const;

    const DriveChain *chain_;
    const Track *track_;
    double t_s_;
    size_t next_ = 0;  // first command later than t_s_
};

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// Shows a swarm: in a window, as a picture, as a video. The last two need no display.
#ifndef VIEW_VIEWS_H
#define VIEW_VIEWS_H

#include <memory>
#include <string>
#include <vector>

#include "swarm/swarm.h"

namespace twin
{

// What a robot looks over, drawn on the floor.
struct ViewCone
{
    double range_m, angle_rad, pan_rad;
};

struct ViewOptions
{
    bool window = false;
    std::string picture, video;   // files; empty: none
    std::string mjcf;             // of the robot
    std::vector<ViewCone> cones;  // one a robot
};

class Views
{
public:
    // Opens what is asked for. Throws std::runtime_error in one sentence if it cannot be shown.
    explicit Views(const ViewOptions &options);
    ~Views();
    Views(const Views &) = delete;

    // After every control step. While the person pauses this waits; returns for how long, in s.
    double Show(const Swarm &swarm);
    // True once the person has closed the window.
    bool Closed() const;
    // Writes the picture and ends the video.
    void Finish(const Swarm &swarm);

private:
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

}  // namespace twin

#endif

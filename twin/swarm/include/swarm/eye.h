// SPDX-License-Identifier: Apache-2.0
// What a robot decides by, where that is more than the cone's bit.
#ifndef SWARM_EYE_H
#define SWARM_EYE_H

#include <cstdint>
#include <span>

#include "fw/behavior.h"
#include "fw/step.h"
#include "plant/plant.h"

namespace twin
{

// Rows of YUYV without padding.
struct Picture
{
    std::span<const uint8_t> yuyv;
    int width_px = 0, height_px = 0;
};

class Eye
{
public:
    virtual ~Eye() = default;
    // One control step of the robot's `firmware` while all robots are at `poses`; `out` is always
    // written. `now_us` is the robots' clock.
    virtual void Decide(std::span<const Pose2> poses, int64_t now_us, fw_ctx &firmware,
                        fw_output &out) = 0;
    // The robot plays `behavior` from now on: for those who do not leave that to its `firmware`.
    virtual void Select(const fw_behavior &) {}
    // What was drawn last, empty before; valid until the next Decide().
    virtual Picture LastPicture() const = 0;
};

}  // namespace twin

#endif

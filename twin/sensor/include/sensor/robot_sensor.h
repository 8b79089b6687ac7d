// SPDX-License-Identifier: Apache-2.0
// What a robot of a swarm decides by: the cone's bits, drawn frames, or the robot's own program.
#ifndef SENSOR_ROBOT_SENSOR_H
#define SENSOR_ROBOT_SENSOR_H

#include <cstdint>
#include <limits>
#include <span>

#include "fw/behavior.h"
#include "fw/step.h"
#include "plant/plant.h"
#include "sensor/scene.h"

namespace twin
{

// Rows of YUYV without padding.
struct Image
{
    std::span<const uint8_t> yuyv;
    int width_px = 0, height_px = 0;
};

// What is before the cameras of a swarm: all robots, or those that one of them may see.
struct Sight
{
    std::span<const Pose2> poses;
    size_t self;                           // the place in `poses` of the robot that looks
    std::span<const Colour> colours = {};  // of the targets on them; empty: TargetColour()
    std::span<const SeenBody> bodies = {};
};

// A robot's sensor. Each control step exposes it once, also while a script drives the robot.
class RobotSensor
{
public:
    virtual ~RobotSensor() = default;

    // Robots at least this far away do not matter, in m; infinite: all do.
    virtual double ReachM() const { return std::numeric_limits<double>::infinity(); }
    // Exposes a frame at `now_us` of the robots' clock. `sight` may leave out robots that are
    // ReachM() away or farther.
    virtual void Expose(const Sight &sight, int64_t now_us) = 0;
    // One control step of the robot's `firmware` with what has arrived by the last Expose(), which
    // was at the same `now_us`. Writes all of `out`.
    virtual void Decide(int64_t now_us, fw_ctx &firmware, fw_output &out) = 0;
    // The robot plays `behavior` from now on. For sensors whose decisions are not made by the
    // `firmware` of Decide().
    virtual void Select(const fw_behavior &) {}
    // What was drawn last, valid until the next Decide(); empty for a sensor that draws nothing.
    virtual Image LastImage() const { return {}; }
};

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// The camera as geometry: one bit that says whether another robot is in a cone ahead.
#ifndef SENSOR_CONE_SENSOR_H
#define SENSOR_CONE_SENSOR_H

#include <cstdint>
#include <deque>
#include <optional>
#include <span>

#include "model_file/model.h"
#include "plant/plant.h"
#include "plant/random.h"

namespace twin
{

// Whether `eye` sees `target`: its centre strictly within range_m, and strictly within half of
// cone_rad of the heading. A target_radius_m above zero: any part of that disc may be in the cone.
bool InView(const Pose2 &eye, const Pose2 &target, const Sensor &sensor);

// One frame of the sensor that has reached the controller.
struct SensorFrame
{
    bool detected;
    uint32_t seq;
    int64_t utime_us;  // exposure
};

class ConeSensor
{
public:
    // `sensor` holds this robot's own range, cone and error rates.
    ConeSensor(const Sensor &sensor, int robot, uint64_t seed);

    // Exposes a frame at `utime_us`, misses and imagines targets at the given rates, and returns
    // the newest frame that is delay_s old or older; none if no further one has arrived.
    std::optional<SensorFrame> Expose(std::span<const Pose2> poses, int64_t utime_us);

private:
    Sensor sensor_;
    size_t self_;
    Random random_;
    int64_t delay_us_;
    uint32_t seq_ = 0;
    std::deque<SensorFrame> on_the_way_;
};

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// The camera as one bit per frame: geometry, errors and delays.
#ifndef SENSOR_CONE_SENSOR_H
#define SENSOR_CONE_SENSOR_H

#include <cstdint>
#include <deque>
#include <optional>
#include <span>

#include "plant/random.h"
#include "sensor/robot_sensor.h"
#include "sensor/view.h"

namespace twin
{

// One frame of the sensor that has reached the controller.
struct SensorFrame
{
    bool detected;
    uint32_t seq;
    int64_t utime_us;  // time stamp
};

class ConeSensor final : public RobotSensor
{
public:
    // `detection` is this robot's own, effects included (Model::MakeDetectionModel).
    ConeSensor(const DetectionModel &detection, int robot, uint64_t seed);

    // Exposes a frame at `utime_us`, misses and imagines targets at the given rates, and stamps it
    // age_s later. Returns the newest frame whose stamp is delay_s old or older; none if no further
    // one has arrived. `poses` and `self` as in Expose().
    std::optional<SensorFrame> Next(std::span<const Pose2> poses, size_t self, int64_t utime_us);

    // Infinite if the range has a soft edge.
    double ReachM() const override;
    void Expose(std::span<const Pose2> poses, size_t self, int64_t now_us) override;
    void Decide(int64_t now_us, fw_ctx &firmware, fw_output &out) override;

private:
    bool Seen(std::span<const Pose2> poses, size_t self);

    DetectionModel detection_;
    Random random_;
    int64_t age_us_, delay_us_;
    uint32_t seq_ = 0;
    std::deque<SensorFrame> on_the_way_;
    std::optional<SensorFrame> arrived_;
};

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// The camera as bits of each frame: geometry, errors and delays.
#ifndef SENSOR_CONE_SENSOR_H
#define SENSOR_CONE_SENSOR_H

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "plant/random.h"
#include "sensor/robot_sensor.h"
#include "sensor/view.h"

namespace twin
{

// One frame of the sensor that has reached the controller.
struct SensorFrame
{
    uint32_t bits;
    uint32_t seq;
    int64_t utime_us;  // time stamp
};

class ConeSensor final : public RobotSensor
{
public:
    // `detection` is this robot's own, effects included (Model::MakeDetectionModel); `bits` say in
    // which sector of it they see which colours (MakeBits).
    ConeSensor(const DetectionModel &detection, std::span<const fw_bit> bits, int robot,
               uint64_t seed);

    // Exposes a frame at `utime_us`, misses and imagines targets at the given rates, each bit for
    // itself, and stamps it age_s later. Returns the newest frame whose stamp is delay_s old or
    // older; none if no further one has arrived.
    std::optional<SensorFrame> Next(const Sight &sight, int64_t utime_us);

    // Infinite if the range has a soft edge.
    double ReachM() const override;
    void Expose(const Sight &sight, int64_t now_us) override;
    void Decide(int64_t now_us, fw_ctx &firmware, fw_output &out) override;

private:
    // One bit.
    struct Eye
    {
        fw_color_box box;
        DetectionModel detection;
    };
    bool Sees(const Eye &eye, const Sight &sight);
    bool SeesBody(const Eye &eye, const Sight &sight) const;

    DetectionModel detection_;
    Random random_;
    int64_t age_us_, delay_us_;
    uint32_t seq_ = 0;
    std::deque<SensorFrame> on_the_way_;
    std::optional<SensorFrame> arrived_;
    std::vector<Eye> eyes_;
    std::vector<char> shown_;
};

}  // namespace twin

#endif

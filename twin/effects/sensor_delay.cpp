// SPDX-License-Identifier: Apache-2.0
#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "sensor_delay",
    .stage = Stage::kDecide,
    .drives = kAnyDrive,
    .summary = "The picture is older than its time stamp says.",
    .equation = "bit(t) = bit of the poses at t - delay",
    .leaves_out = "jitter, and a rolling shutter",
    .measure =
        "a robot that turns on the spot beside another one at rest, at two speeds, both ways",
    .reference = "time offset of a camera: Furgale, Rehder and Siegwart 2013, IROS",
    .family = Family::kCamera,
    .needs = Needs::kFrames,
    .phrase = "the camera is late",
    .identify = kWatch | kSpin,
};

constexpr Parameter kParameters[] = {
    {"delay_s", "s", 0, 0.05, 0, 1, "exposure to time stamp", "the camera is late",
     "the camera is early"},
};

class SensorDelay final : public Effect
{
public:
    explicit SensorDelay(std::span<const double> v) : delay_s_(v[0]) {}

    void Look(Sight &s) const override { s.age_s += delay_s_; }

private:
    double delay_s_;
};

}  // namespace

extern const EffectSpec kSensorDelay;
const EffectSpec kSensorDelay = {kCard, kParameters, Make<SensorDelay>};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "sensor_delay",
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

constexpr ParameterSpec kParameters[] = {
    {"delay_s", "s", 0, 0.05, 0, 1, "exposure to time stamp", "the camera is late",
     "the camera is early"},
};

void Set(DetectionModel &s, const Numbers &v)
{
    s.age_s += v[0];
}

}  // namespace

EFFECT(sensor_delay) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnDecision{Set},
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "clock_rate",
    .drives = kAnyDrive,
    .summary = "Motion capture's clock runs faster than the robot's.",
    .equation = "t' = t (1 + rate 1e-6), t since the start of the log",
    .leaves_out = "a rate that changes, as with temperature",
    .measure =
        "a log of ten minutes or more with steps at both ends; on short ones clock_offset "
        "looks alike",
    .reference = "clock model of order one; Mills 2016, Computer Network Time Synchronization",
    .family = Family::kClock,
    .needs = Needs::kClocks,
    .phrase = "one clock runs faster than the other",
    .identify = kSteps | kLong,
};

constexpr ParameterSpec kParameters[] = {
    {"rate_ppm", "ppm", 0, 20, -500, 500, "seconds gained on the robot's clock in a million",
     "motion capture's clock runs fast", "motion capture's clock runs slow"},
};

void Observe(ObservedPose &p, const Numbers &v)
{
    p.t_s *= 1 + v[0] * 1e-6;
}

void Invert(ObservedPose &p, const Numbers &v)
{
    p.t_s /= 1 + v[0] * 1e-6;
}

}  // namespace

EFFECT(clock_rate) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnObservation{Observe, Invert},
};

}  // namespace twin

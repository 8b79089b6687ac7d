// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "clock_offset",
    .drives = kAnyDrive,
    .summary = "Motion capture's clock is ahead of the robot's.",
    .equation = "t' = t + offset",
    .leaves_out = "different rates of the clocks",
    .measure =
        "a second mark on both clocks: a flash or a tap; delay and offset look alike without",
    .reference = "clock model of order zero; Mills 2016, Computer Network Time Synchronization",
    .family = Family::kClock,
    .needs = Needs::kClocks,
    .phrase = "the clocks of robot and motion capture differ",
    .identify = kSteps,
};

constexpr ParameterSpec kParameters[] = {
    // As large as a delay is by default: no log tells the one from the other.
    {"offset_s", "s", 0, 0.02, -1.5, 1.5,
     "capture's time stamp less the robot's at the same moment", "motion capture's clock is ahead",
     "motion capture's clock is behind", 0.2, Role::kLateness},
};

void Observe(ObservedPose &p, const Numbers &v)
{
    p.t_s += v[0];
}

void Invert(ObservedPose &p, const Numbers &v)
{
    p.t_s -= v[0];
}

}  // namespace

EFFECT(clock_offset) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnObservation{Observe, Invert},
};

}  // namespace twin

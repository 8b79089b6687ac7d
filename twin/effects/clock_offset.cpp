// SPDX-License-Identifier: Apache-2.0
#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "clock_offset",
    .stage = Stage::kObserve,
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

constexpr Parameter kParameters[] = {
    {"offset_s", "s", 0, 0.01, -0.5, 0.5,
     "capture's time stamp less the robot's at the same moment", "motion capture's clock is ahead",
     "motion capture's clock is behind", 0.2, Role::kLateness},
};

class ClockOffset final : public Effect
{
public:
    explicit ClockOffset(std::span<const double> v) : offset_s_(v[0]) {}

    void Step(Signals &s, double *) const override { s.observed_t_s += offset_s_; }

    void Invert(Signals &s) const override { s.observed_t_s -= offset_s_; }

private:
    double offset_s_;
};

}  // namespace

extern const EffectSpec kClockOffset;
const EffectSpec kClockOffset = {kCard, kParameters, Make<ClockOffset>};

}  // namespace twin

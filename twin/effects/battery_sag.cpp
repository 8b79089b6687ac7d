// SPDX-License-Identifier: Apache-2.0
#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "battery_sag",
    .stage = Stage::kWheel,
    .drives = kDutyOnly,
    .summary = "Wheels slow down as the battery empties.",
    .equation = "v' = v (1 + strength (V / V_nominal - 1))",
    .leaves_out = "voltage drop inside the driver; needs the pack voltage in the log",
    .measure = "the same drives with a full and with an empty battery",
    .reference = "back-EMF of a DC motor: no-load speed is proportional to voltage (strength 1)",
    .family = Family::kPower,
    .needs = Needs::kBattery,
    .phrase = "wheels slow down as the battery empties",
    .identify = kStraight | kLong,
};

constexpr Parameter kParameters[] = {
    {"strength", "1", 0, 1, -1, 3, "relative loss of speed over relative loss of voltage",
     "slower as the battery empties", "faster as the battery empties"},
};

class BatterySag final : public Effect
{
public:
    explicit BatterySag(std::span<const double> v) : strength_(v[0]) {}

    void Step(Signals &s, double *) const override
    {
        if (!(s.battery_V > 0) || !(s.battery_nominal_V > 0))
            return;
        for (double &target : s.target_mps)
            target *= 1 + strength_ * (s.battery_V / s.battery_nominal_V - 1);
    }

private:
    double strength_;
};

}  // namespace

extern const EffectSpec kBatterySag;
const EffectSpec kBatterySag = {kCard, kParameters, Make<BatterySag>};

}  // namespace twin

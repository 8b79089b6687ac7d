// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "battery_sag",
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

constexpr ParameterSpec kParameters[] = {
    {"strength", "1", 0, 1, -1, 3, "relative loss of speed over relative loss of voltage",
     "slower as the battery empties", "faster as the battery empties"},
};

void Step(WheelSignals &s, const Numbers &v, double *)
{
    const double nominal_V = s.robot.battery_nominal_V;
    if (!(s.battery_V > 0) || !(nominal_V > 0))
        return;
    for (double &target : s.target_mps)
        target *= 1 + v[0] * (s.battery_V / nominal_V - 1);
}

}  // namespace

EFFECT(battery_sag) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnWheels{Step},
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "compass_deviation",
    .drives = kAnyDrive,
    .summary = "The heading that was measured errs with the heading, once a turn.",
    .equation = "theta' = theta + cos cos(theta) + sin sin(theta)",
    .leaves_out = "errors twice a turn (soft iron), and those that change with the place",
    .measure = "the same straight drives along several headings, at least a quarter turn apart",
    .reference =
        "hard-iron coefficients B and C of a compass; NGA 2004, Handbook of Magnetic Compass "
        "Adjustment",
    .family = Family::kFrame,
    .needs = Needs::kHeading,
    .phrase = "the measured heading errs with the heading",
    .identify = kStraight | kHeadings,
};

constexpr ParameterSpec kParameters[] = {
    {"cos_rad", "rad", 0, 0.03, -0.5, 0.5, "heading seen less the robot's own, along x of the room",
     "", "", 0.1},
    {"sin_rad", "rad", 0, 0.03, -0.5, 0.5, "heading seen less the robot's own, along y of the room",
     "", "", 0.1},
};

double Deviation(double theta_rad, const Numbers &v)
{
    return v[0] * std::cos(theta_rad) + v[1] * std::sin(theta_rad);
}

void Observe(ObservedPose &p, const Numbers &v)
{
    p.theta_rad += Deviation(p.theta_rad, v);
}

// Newton's iteration: the deviation's slope is below 1 for all parameters, so that the heading seen
// rises with the robot's own.
void Invert(ObservedPose &p, const Numbers &v)
{
    constexpr int kRounds = 6;
    const double seen_rad = p.theta_rad;
    for (int round = 0; round < kRounds; ++round)
    {
        const double slope = 1 - v[0] * std::sin(p.theta_rad) + v[1] * std::cos(p.theta_rad);
        p.theta_rad -= (p.theta_rad + Deviation(p.theta_rad, v) - seen_rad) / slope;
    }
}

}  // namespace

EFFECT(compass_deviation) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnObservation{Observe, Invert},
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "marker_offset",
    .drives = kAnyDrive,
    .summary = "The tracked point is not the point about which the robot turns.",
    .equation = "p' = p + R(theta) (x, y)",
    .leaves_out = "height and tilt of the marker body",
    .measure = "turns on the spot, both ways",
    .reference = "rigid-body transform",
    .family = Family::kFrame,
    .needs = Needs::kPoses,
    .phrase = "the tracked point is off the centre of turning",
    .identify = kSpin,
};

constexpr ParameterSpec kParameters[] = {
    {"x_m", "m", 0, 0.01, -3, 3, "marker ahead of the robot's centre",
     "tracked point ahead of the centre", "tracked point behind the centre", 0.03},
    {"y_m", "m", 0, 0.01, -3, 3, "marker left of the robot's centre",
     "tracked point left of the centre", "tracked point right of the centre", 0.03},
};

// Moves the pose seen by `sign` times the offset.
void Shift(ObservedPose &p, const Numbers &v, double sign)
{
    const double c = std::cos(p.theta_rad), d = std::sin(p.theta_rad);
    p.x_m += sign * (c * v[0] - d * v[1]);
    p.y_m += sign * (d * v[0] + c * v[1]);
}

void Observe(ObservedPose &p, const Numbers &v)
{
    Shift(p, v, 1);
}

void Invert(ObservedPose &p, const Numbers &v)
{
    Shift(p, v, -1);
}

}  // namespace

EFFECT(marker_offset) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnObservation{Observe, Invert},
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "heading_bias",
    .drives = kAnyDrive,
    .summary = "The tracked body's heading is turned against the robot's.",
    .equation = "theta' = theta + bias",
    .leaves_out = "roll and pitch of the marker body",
    .measure = "straight drives forward and sideways: without the latter it looks like wheel_gain",
    .reference = "rigid-body transform",
    .family = Family::kFrame,
    .needs = Needs::kHeading,
    .phrase = "the tracked heading is turned against the robot",
    .identify = kStraight | kStrafe,
};

constexpr ParameterSpec kParameters[] = {
    {"bias_rad", "rad", 0, 0.02, -0.6, 0.6, "heading seen less the robot's own",
     "tracked heading turned left", "tracked heading turned right", 0.1},
};

void Observe(ObservedPose &p, const Numbers &v)
{
    p.theta_rad += v[0];
}

void Invert(ObservedPose &p, const Numbers &v)
{
    p.theta_rad -= v[0];
}

}  // namespace

EFFECT(heading_bias) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnObservation{Observe, Invert},
};

}  // namespace twin

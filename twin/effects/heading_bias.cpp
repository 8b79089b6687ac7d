// SPDX-License-Identifier: Apache-2.0
#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "heading_bias",
    .stage = Stage::kObserve,
    .drives = kAnyDrive,
    .summary = "The tracked body's heading is turned against the robot's.",
    .equation = "theta' = theta + bias",
    .leaves_out = "roll and pitch of the marker body",
    .measure = "straight drives forward and sideways: without the latter it looks like wheel_gain",
    .reference = "rigid-body transform",
    .family = Family::kFrame,
    .needs = Needs::kPoses,
    .phrase = "the tracked heading is turned against the robot",
    .identify = kStraight | kStrafe,
};

constexpr Parameter kParameters[] = {
    {"bias_rad", "rad", 0, 0.02, -0.6, 0.6, "heading seen less the robot's own",
     "tracked heading turned left", "tracked heading turned right", 0.1},
};

class HeadingBias final : public Effect
{
public:
    explicit HeadingBias(std::span<const double> v) : bias_rad_(v[0]) {}

    void Step(Signals &s, double *) const override { s.theta_rad += bias_rad_; }
    void Invert(Signals &s) const override { s.theta_rad -= bias_rad_; }

private:
    double bias_rad_;
};

}  // namespace

extern const EffectSpec kHeadingBias;
const EffectSpec kHeadingBias = {kCard, kParameters, Make<HeadingBias>};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "reverse_asymmetry",
    .stage = Stage::kWheel,
    .drives = kAnyDrive,
    .summary =
        "Wheels that turn backwards are slower or faster than forwards, each side by its own factor.",
    .equation = "v' = v (1 + side) where v < 0",
    .leaves_out = "differences between front and rear wheels",
    .measure = "straight drives forward and back at the same duties",
    .reference =
        "brush motors with advanced timing; seen on a TurboPi as a yaw drift that changes in reverse",
    .family = Family::kGain,
    .needs = Needs::kSteadySpeed,
    .phrase = "wheels differ in reverse",
    .identify = kStraight | kReversals,
    .suspect_when = kSteady,
};

constexpr Parameter kParameters[] = {
    {"left", "1", 0, 0.03, -0.5, 0.5, "relative change of the left wheels' speed in reverse",
     "left wheels strong in reverse", "left wheels weak in reverse"},
    {"right", "1", 0, 0.03, -0.5, 0.5, "relative change of the right wheels' speed in reverse",
     "right wheels strong in reverse", "right wheels weak in reverse"},
};

class ReverseAsymmetry final : public Effect
{
public:
    explicit ReverseAsymmetry(std::span<const double> v) : side_{v[0], v[1]} {}

    void Step(Signals &s, double *) const override
    {
        for (int k = 0; k < kWheels; ++k)
            if (s.target_mps[k] < 0)
                s.target_mps[k] *= 1 + side_[k % 2];
    }

private:
    std::array<double, 2> side_;  // left, right
};

}  // namespace

extern const EffectSpec kReverseAsymmetry;
const EffectSpec kReverseAsymmetry = {kCard, kParameters, Make<ReverseAsymmetry>};

}  // namespace twin

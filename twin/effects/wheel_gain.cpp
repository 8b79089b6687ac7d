// SPDX-License-Identifier: Apache-2.0
#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "wheel_gain",
    .stage = Stage::kWheel,
    .drives = kAnyDrive,
    .summary = "Wheels differ in speed at the same duty.",
    .equation = "v_k' = v_k (1 + gain_k)",
    .leaves_out = "dependence on speed and direction; the mean of the four is the base gain",
    .measure = "straight drives forward and sideways, turns on the spot",
    .reference =
        "Borenstein and Feng 1996, Measurement and correction of systematic odometry errors in mobile robots",
    .family = Family::kGain,
    .needs = Needs::kSteadySpeed,
    .phrase = "wheels differ in strength",
    .identify = kStraight | kStrafe | kSpin,
    .suspect_when = kSteady,
};

constexpr Parameter kParameters[] = {
    {"fl", "1", 0, 0.03, -0.5, 0.5, "relative change of the front left wheel's speed",
     "front left wheel strong", "front left wheel weak", 0.05},
    {"fr", "1", 0, 0.03, -0.5, 0.5, "relative change of the front right wheel's speed",
     "front right wheel strong", "front right wheel weak", 0.05},
    {"rl", "1", 0, 0.03, -0.5, 0.5, "relative change of the rear left wheel's speed",
     "rear left wheel strong", "rear left wheel weak", 0.05},
    {"rr", "1", 0, 0.03, -0.5, 0.5, "relative change of the rear right wheel's speed",
     "rear right wheel strong", "rear right wheel weak", 0.05},
};

class WheelGain final : public Effect
{
public:
    explicit WheelGain(std::span<const double> v) : gain_{v[0], v[1], v[2], v[3]} {}

    void Step(Signals &s, double *) const override
    {
        for (int k = 0; k < kWheels; ++k)
            s.target_mps[k] *= 1 + gain_[k];
    }

private:
    Wheels gain_;
};

}  // namespace

extern const EffectSpec kWheelGain;
const EffectSpec kWheelGain = {kCard, kParameters, Make<WheelGain>};

}  // namespace twin

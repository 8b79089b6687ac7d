// SPDX-License-Identifier: Apache-2.0
#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "missed_detection",
    .stage = Stage::kDecide,
    .drives = kAnyDrive,
    .summary = "More or fewer frames than the model says miss a target that is in view.",
    .equation =
        "P(bit | in view) = 1 - miss', miss' = miss + rate (1 - miss), below 0: "
        "(1 + rate) miss",
    .leaves_out = "misses that come in bursts, as behind a reflection",
    .measure = "two robots at rest, well in view, many frames",
    .reference =
        "binary asymmetric channel; Cover and Thomas 2006, Elements of Information Theory, ch. 7",
    .family = Family::kCamera,
    .needs = Needs::kFrames,
    .phrase = "the camera misses targets",
    .identify = kWatch,
};

constexpr Parameter kParameters[] = {
    {"rate", "1", 0, 0.1, -1, 1,
     "share of frames missed beyond those of the model; below 0: share of the model's that are not",
     "misses targets more often", "misses targets less often"},
};

class MissedDetection final : public Effect
{
public:
    explicit MissedDetection(std::span<const double> v) : rate_(v[0]) {}

    void Look(Sight &s) const override
    {
        s.miss_rate += rate_ * (rate_ > 0 ? 1 - s.miss_rate : s.miss_rate);
    }

private:
    double rate_;
};

}  // namespace

extern const EffectSpec kMissedDetection;
const EffectSpec kMissedDetection = {kCard, kParameters, Make<MissedDetection>};

}  // namespace twin

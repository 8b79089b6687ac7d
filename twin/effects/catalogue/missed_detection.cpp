// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "missed_detection",
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

constexpr ParameterSpec kParameters[] = {
    {"rate", "1", 0, 0.1, -1, 1,
     "share of frames missed beyond those of the model; below 0: share of the model's that are not",
     "misses targets more often", "misses targets less often"},
};

void Set(DetectionModel &s, const Numbers &v)
{
    s.miss_rate += v[0] * (v[0] > 0 ? 1 - s.miss_rate : s.miss_rate);
}

}  // namespace

EFFECT(missed_detection) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnDecision{Set},
};

}  // namespace twin

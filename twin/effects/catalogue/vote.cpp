// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "vote",
    .drives = kAnyDrive,
    .summary = "The robot votes over another number of frames than the model says.",
    .equation =
        "n' = n + extra_frames, at least 1 and at most 64; seen if more than half of n' frames show it",
    .leaves_out = "votes with weights or another share",
    .measure = "any run with raw and voted bits in its telemetry",
    .reference = "majority decoding of a repetition code; MacKay 2003, Information Theory, ch. 1.2",
    .family = Family::kCamera,
    .needs = Needs::kRawFrames,
    .phrase = "another number of frames votes",
    .identify = kWatch,
};

constexpr ParameterSpec kParameters[] = {
    {"extra_frames", "1", 0, 5, -63, 63,
     "frames beyond those of the model, rounded to a whole number", "more frames vote",
     "fewer frames vote"},
};

void Set(DetectionModel &s, const Numbers &v)
{
    s.vote_frames = std::clamp(s.vote_frames + std::round(v[0]), 1.0, 64.0);
}

}  // namespace

EFFECT(vote) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnDecision{Set},
};

}  // namespace twin

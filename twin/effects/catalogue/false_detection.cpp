// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "false_detection",
    .drives = kAnyDrive,
    .summary = "More or fewer frames than the model says show a target that is not there.",
    .equation =
        "P(bit | nothing in view) = false', false' = false + rate (1 - false), below 0: "
        "(1 + rate) false",
    .leaves_out = "false targets at one place of the room, as a green bottle",
    .measure = "one robot alone in the room, many frames",
    .reference =
        "binary asymmetric channel; Cover and Thomas 2006, Elements of Information Theory, ch. 7",
    .family = Family::kCamera,
    .needs = Needs::kFrames,
    .phrase = "the camera sees targets that are not there",
    .identify = kWatch,
};

constexpr ParameterSpec kParameters[] = {
    {"rate", "1", 0, 0.1, -1, 1,
     "share of frames beyond those of the model; below 0: share of the model's that are right",
     "sees what is not there more often", "sees what is not there less often"},
};

void Set(DetectionModel &s, const Numbers &v)
{
    s.false_rate += v[0] * (v[0] > 0 ? 1 - s.false_rate : s.false_rate);
}

}  // namespace

EFFECT(false_detection) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnDecision{Set},
};

}  // namespace twin

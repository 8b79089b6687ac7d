// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "view_range",
    .drives = kAnyDrive,
    .summary = "The camera sees farther or less far than the model says, and the edge may be soft.",
    .equation =
        "R' = factor R; P(seen at d) = 1 / (1 + exp((d - R') / softness)), a step at softness 0",
    .leaves_out = "light, and the size of the target in the picture",
    .measure = "robots at rest at several distances around the range, many frames each",
    .reference = "logistic psychometric function: Treutwein 1995, Vision Research 35(17) 2503",
    .family = Family::kCamera,
    .needs = Needs::kFrames,
    .phrase = "the camera sees another distance",
    .identify = kWatch,
};

constexpr ParameterSpec kParameters[] = {
    {"factor", "1", 1, 0.8, 0.05, 5, "range over that of the model", "sees farther",
     "sees less far"},
    {"softness_m", "m", 0, 0.02, 0, 2,
     "scale of the edge: seen in 73 % of the frames so far before it, in 27 % so far behind",
     "the edge of sight is soft", "the edge of sight is sharp"},
};

void Set(DetectionModel &s, const Numbers &v)
{
    s.range_m *= v[0];
    s.softness_m += v[1];
}

}  // namespace

EFFECT(view_range) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnView{Set},
};

}  // namespace twin

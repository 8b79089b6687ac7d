// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <numbers>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "view_angle",
    .drives = kAnyDrive,
    .summary = "The camera sees wider or narrower than the model says.",
    .equation = "cone' = min(2 pi, factor cone)",
    .leaves_out = "edges that differ left and right: view_pan",
    .measure = "a robot turned on the spot beside another one at rest, slowly, both ways",
    .reference =
        "field of view of a pinhole camera; Hartley and Zisserman 2004, Multiple View Geometry, ch. 6",
    .family = Family::kCamera,
    .needs = Needs::kFrames,
    .phrase = "the camera sees another angle",
    .identify = kWatch | kSpin,
};

constexpr ParameterSpec kParameters[] = {
    {"factor", "1", 1, 0.8, 0.05, 8, "opening angle over that of the model", "sees a wider angle",
     "sees a narrower angle"},
};

void Set(DetectionModel &s, const Numbers &v)
{
    s.cone_rad = std::min(s.cone_rad * v[0], 2 * std::numbers::pi);
}

}  // namespace

EFFECT(view_angle) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnView{Set},
};

}  // namespace twin

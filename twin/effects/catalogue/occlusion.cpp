// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "occlusion",
    .drives = kAnyDrive,
    .summary = "Bodies of other robots hide the targets behind them.",
    .equation =
        "hidden if a nearer body of that radius lies across the line to the target's centre",
    .leaves_out = "targets hidden in part; heights of targets and bodies",
    .measure =
        "three robots in a row, the middle one half out of the picture: alone it is not seen, yet it hides the third",
    .reference =
        "line of sight against discs; Ericson 2005, Real-Time Collision Detection, ch. 5.3",
    .family = Family::kCamera,
    .needs = Needs::kFrames,
    .phrase = "other robots hide targets",
    .identify = kWatch,
};

constexpr ParameterSpec kParameters[] = {
    {"radius_m", "m", 0, 0.08, 0, 1, "of the bodies that hide", "robots hide what is behind them",
     "robots hide less"},
};

void Set(DetectionModel &s, const Numbers &v)
{
    s.hide_radius_m += v[0];
}

}  // namespace

EFFECT(occlusion) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnView{Set},
};

}  // namespace twin

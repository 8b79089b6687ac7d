// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "view_pan",
    .drives = kAnyDrive,
    .summary = "The camera does not look straight ahead.",
    .equation = "bearing' = bearing - pan",
    .leaves_out = "roll and tilt of the camera",
    .measure =
        "a robot turned on the spot beside another one at rest: the bit must come and go symmetrically",
    .reference =
        "yaw of the camera's extrinsic calibration; Hartley and Zisserman 2004, Multiple View Geometry, ch. 6",
    .family = Family::kCamera,
    .needs = Needs::kFrames,
    .phrase = "the camera does not look straight ahead",
    .identify = kWatch | kSpin,
};

constexpr ParameterSpec kParameters[] = {
    {"pan_rad", "rad", 0, 0.1, -3.15, 3.15, "axis of the camera left of the heading",
     "camera looks to the left", "camera looks to the right"},
};

void Set(DetectionModel &s, const Numbers &v)
{
    s.pan_rad += v[0];
}

}  // namespace

EFFECT(view_pan) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnView{Set},
};

}  // namespace twin

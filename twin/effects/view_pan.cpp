// SPDX-License-Identifier: Apache-2.0
#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "view_pan",
    .stage = Stage::kView,
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

constexpr Parameter kParameters[] = {
    {"pan_rad", "rad", 0, 0.1, -3.15, 3.15, "axis of the camera left of the heading",
     "camera looks to the left", "camera looks to the right"},
};

class ViewPan final : public Effect
{
public:
    explicit ViewPan(std::span<const double> v) : pan_rad_(v[0]) {}

    void Look(Sight &s) const override { s.pan_rad += pan_rad_; }

private:
    double pan_rad_;
};

}  // namespace

extern const EffectSpec kViewPan;
const EffectSpec kViewPan = {kCard, kParameters, Make<ViewPan>};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <numbers>

#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "view_angle",
    .stage = Stage::kView,
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

constexpr Parameter kParameters[] = {
    {"factor", "1", 1, 0.8, 0.05, 8, "opening angle over that of the model", "sees a wider angle",
     "sees a narrower angle"},
};

class ViewAngle final : public Effect
{
public:
    explicit ViewAngle(std::span<const double> v) : factor_(v[0]) {}

    void Look(Sight &s) const override
    {
        s.cone_rad = std::min(s.cone_rad * factor_, 2 * std::numbers::pi);
    }

private:
    double factor_;
};

}  // namespace

extern const EffectSpec kViewAngle;
const EffectSpec kViewAngle = {kCard, kParameters, Make<ViewAngle>};

}  // namespace twin

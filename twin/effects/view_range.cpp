// SPDX-License-Identifier: Apache-2.0
#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "view_range",
    .stage = Stage::kView,
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

constexpr Parameter kParameters[] = {
    {"factor", "1", 1, 0.8, 0.05, 5, "range over that of the model", "sees farther",
     "sees less far"},
    {"softness_m", "m", 0, 0.02, 0, 2,
     "scale of the edge: seen in 73 % of the frames so far before it, in 27 % so far behind",
     "the edge of sight is soft", "the edge of sight is sharp"},
};

class ViewRange final : public Effect
{
public:
    explicit ViewRange(std::span<const double> v) : factor_(v[0]), softness_m_(v[1]) {}

    void Look(Sight &s) const override
    {
        s.range_m *= factor_;
        s.softness_m += softness_m_;
    }

private:
    double factor_, softness_m_;
};

}  // namespace

extern const EffectSpec kViewRange;
const EffectSpec kViewRange = {kCard, kParameters, Make<ViewRange>};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "occlusion",
    .stage = Stage::kView,
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

constexpr Parameter kParameters[] = {
    {"radius_m", "m", 0, 0.08, 0, 1, "of the bodies that hide", "robots hide what is behind them",
     "robots hide less"},
};

class Occlusion final : public Effect
{
public:
    explicit Occlusion(std::span<const double> v) : radius_m_(v[0]) {}

    void Look(Sight &s) const override { s.hide_radius_m += radius_m_; }

private:
    double radius_m_;
};

}  // namespace

extern const EffectSpec kOcclusion;
const EffectSpec kOcclusion = {kCard, kParameters, Make<Occlusion>};

}  // namespace twin

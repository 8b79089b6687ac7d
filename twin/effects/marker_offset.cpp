// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "marker_offset",
    .stage = Stage::kObserve,
    .drives = kAnyDrive,
    .summary = "The tracked point is not the point about which the robot turns.",
    .equation = "p' = p + R(theta) (x, y)",
    .leaves_out = "height and tilt of the marker body",
    .measure = "turns on the spot, both ways",
    .reference = "rigid-body transform",
    .family = Family::kFrame,
    .needs = Needs::kPoses,
    .phrase = "the tracked point is off the centre of turning",
    .identify = kSpin,
};

constexpr Parameter kParameters[] = {
    {"x_m", "m", 0, 0.01, -0.5, 0.5, "marker ahead of the robot's centre",
     "tracked point ahead of the centre", "tracked point behind the centre", 0.03},
    {"y_m", "m", 0, 0.01, -0.5, 0.5, "marker left of the robot's centre",
     "tracked point left of the centre", "tracked point right of the centre", 0.03},
};

class MarkerOffset final : public Effect
{
public:
    explicit MarkerOffset(std::span<const double> v) : x_m_(v[0]), y_m_(v[1]) {}

    void Step(Signals &s, double *) const override { Shift(s, 1); }

    void Invert(Signals &s) const override { Shift(s, -1); }

private:
    // Moves the pose seen by `sign` times the offset.
    void Shift(Signals &s, double sign) const
    {
        const double c = std::cos(s.theta_rad), d = std::sin(s.theta_rad);
        s.x_m += sign * (c * x_m_ - d * y_m_);
        s.y_m += sign * (d * x_m_ + c * y_m_);
    }

    double x_m_, y_m_;
};

}  // namespace

extern const EffectSpec kMarkerOffset;
const EffectSpec kMarkerOffset = {kCard, kParameters, Make<MarkerOffset>};

}  // namespace twin

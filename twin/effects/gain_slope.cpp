// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "gain_slope",
    .stage = Stage::kGround,
    .drives = kAnyDrive,
    .summary = "Speed rises across the room.",
    .equation = "v' = v (1 + gx x + gy y), v = (vx, vy), (x, y) the robot's place in W",
    .leaves_out = "slopes of the turn rate; curvature",
    .measure =
        "the same drives at places two metres apart, at several headings; at one place "
        "base.forward_gain and base.sideways_gain look alike, over time battery_sag and "
        "heat_gain",
    .reference = "first-order expansion of a gain that depends on place",
    .family = Family::kPlace,
    .needs = Needs::kRoom,
    .phrase = "faster at one end of the room",
    .identify = kStraight | kPlaces | kHeadings,
};

constexpr Parameter kParameters[] = {
    {"x_per_m", "1/m", 0, 0.02, -0.3, 0.3, "gx: relative rise of speed per metre along x of W",
     "faster at large x", "faster at small x"},
    {"y_per_m", "1/m", 0, 0.02, -0.3, 0.3, "gy: the same along y", "faster at large y",
     "faster at small y"},
};

class GainSlope final : public Effect
{
public:
    explicit GainSlope(std::span<const double> v) : x_per_m_(v[0]), y_per_m_(v[1]) {}

    // The gain grows exponentially on its own way: exact on straight lines.
    void Step(Signals &s, double *) const override
    {
        const double heading_rad = s.theta_rad + s.omega_radps * s.dt_s / 2;
        const double c = std::cos(heading_rad), d = std::sin(heading_rad);
        const double rise =
            (x_per_m_ * (c * s.vx_mps - d * s.vy_mps) + y_per_m_ * (d * s.vx_mps + c * s.vy_mps)) *
            s.dt_s;
        const double mean = std::abs(rise) > 1e-9 ? std::expm1(rise) / rise : 1;
        const double factor = (1 + x_per_m_ * s.x_m + y_per_m_ * s.y_m) * mean;
        s.vx_mps *= factor;
        s.vy_mps *= factor;
    }

private:
    double x_per_m_, y_per_m_;
};

}  // namespace

extern const EffectSpec kGainSlope;
const EffectSpec kGainSlope = {kCard, kParameters, Make<GainSlope>};

}  // namespace twin

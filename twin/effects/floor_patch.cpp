// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "floor_patch",
    .stage = Stage::kGround,
    .drives = kAnyDrive,
    .summary = "On a round patch of the floor the robot is slower.",
    .equation =
        "v' = v (1 - strength w), omega' = omega (1 - strength w), w = (1 - tanh((d - radius)"
        " / 0.1 m)) / 2, d the distance of the robot from (x, y)",
    .leaves_out = "patches of other shapes; wheels that are on the patch one by one",
    .measure =
        "drives across the whole floor, the same paths shifted by half a metre; a patch "
        "larger than the paths is a gain of the base or gain_slope",
    .reference = "a step of the gain with a smooth edge, so that its place can be fitted",
    .family = Family::kPlace,
    .needs = Needs::kRoom,
    .phrase = "slower on one patch of the floor",
    .identify = kStraight | kPlaces,
};

constexpr Parameter kParameters[] = {
    {"strength", "1", 0, 0.2, -1, 0.95, "relative loss of speed on the patch",
     "slower on a patch of the floor", "faster on a patch of the floor"},
    {"x_m", "m", 0, 0.3, -5, 5, "centre in W; means nothing at strength 0", "", "", 0,
     Role::kPlace},
    {"y_m", "m", 0, 0.2, -5, 5, "centre in W; means nothing at strength 0", "", "", 0,
     Role::kPlace},
    {"radius_m", "m", 0.5, 0.3, 0.02, 3, "of the patch; means nothing at strength 0"},
};

// A robot's wheels reach a patch one by one: its edge is about as wide as the robot.
constexpr double kEdge_m = 0.1;

class FloorPatch final : public Effect
{
public:
    explicit FloorPatch(std::span<const double> v)
        : strength_(v[0]), x_m_(v[1]), y_m_(v[2]), radius_m_(v[3])
    {
    }

    // Takes the factor at the middle of the step's way: right to second order.
    void Step(Signals &s, double *) const override
    {
        if (strength_ == 0)
            return;
        const double half_s = s.dt_s / 2 * Factor(s.x_m, s.y_m);
        const double heading_rad = s.theta_rad + s.omega_radps * half_s / 2;
        const double c = std::cos(heading_rad), d = std::sin(heading_rad);
        const double factor = Factor(s.x_m + half_s * (c * s.vx_mps - d * s.vy_mps),
                                     s.y_m + half_s * (d * s.vx_mps + c * s.vy_mps));
        s.vx_mps *= factor;
        s.vy_mps *= factor;
        s.omega_radps *= factor;
    }

private:
    double Factor(double x_m, double y_m) const
    {
        const double outside_m = std::hypot(x_m - x_m_, y_m - y_m_) - radius_m_;
        return 1 - strength_ * (1 - std::tanh(outside_m / kEdge_m)) / 2;
    }

    double strength_, x_m_, y_m_, radius_m_;
};

}  // namespace

extern const EffectSpec kFloorPatch;
const EffectSpec kFloorPatch = {kCard, kParameters, Make<FloorPatch>};

}  // namespace twin

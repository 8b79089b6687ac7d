// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "floor_patch",
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

constexpr ParameterSpec kParameters[] = {
    {"strength", "1", 0, 0.2, -1, 0.95, "relative loss of speed on the patch",
     "slower on a patch of the floor", "faster on a patch of the floor"},
    {"x_m", "m", 0, 0.3, -100, 100, "centre in W; means nothing at strength 0", "", "", 1,
     Role::kPlace},
    {"y_m", "m", 0, 0.2, -100, 100, "centre in W; means nothing at strength 0", "", "", 1,
     Role::kPlace},
    {"radius_m", "m", 0.5, 0.3, 0.02, 10, "of the patch; means nothing at strength 0", "", "", 0,
     Role::kPlace},
};

// A robot's wheels reach a patch one by one: its edge is about as wide as the robot.
constexpr double kEdge_m = 0.1;

// (1 - tanh(u)) / 2 is 1 / (1 + exp(2 u)).
double Factor(double x_m, double y_m, const Numbers &v)
{
    const double dx_m = x_m - v[1], dy_m = y_m - v[2];
    const double outside_m = std::sqrt(dx_m * dx_m + dy_m * dy_m) - v[3];
    return 1 - v[0] / (1 + std::exp(2 * outside_m / kEdge_m));
}

// Takes the factor at the middle of the step's way: right to second order.
void Step(GroundSignals &s, const Numbers &v, double *)
{
    if (v[0] == 0)
        return;
    const double half_s = s.dt_s / 2 * Factor(s.x_m, s.y_m, v);
    const auto [c, d] = s.AheadAfter(half_s / 2);
    const double factor = Factor(s.x_m + half_s * (c * s.vx_mps - d * s.vy_mps),
                                 s.y_m + half_s * (d * s.vx_mps + c * s.vy_mps), v);
    s.vx_mps *= factor;
    s.vy_mps *= factor;
    s.omega_radps *= factor;
}

}  // namespace

EFFECT(floor_patch) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{Step},
};

}  // namespace twin

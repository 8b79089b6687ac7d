// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
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

// Robots that are looked at together: the processor goes on with one while it waits for the root
// or the exponential of another.
constexpr size_t kTogether = 8;
using Each = std::array<double, kTogether>;

// Of `count` places. (1 - tanh(u)) / 2 is 1 / (1 + exp(2 u)).
Each Factors(const Each &x_m, const Each &y_m, size_t count, const Numbers &v)
{
    Each factors{};
    for (size_t i = 0; i < count; ++i)
    {
        const double dx_m = x_m[i] - v[1], dy_m = y_m[i] - v[2];
        factors[i] = 2 / kEdge_m * (std::sqrt(dx_m * dx_m + dy_m * dy_m) - v[3]);
    }
    for (size_t i = 0; i < count; ++i)
        factors[i] = std::exp(factors[i]);
    for (size_t i = 0; i < count; ++i)
        factors[i] = 1 - v[0] / (1 + factors[i]);
    return factors;
}

// Takes the factor at the middle of the step's way: right to second order.
void Some(std::span<GroundSignals> robots, const Numbers &v)
{
    Each x_m{}, y_m{};
    for (size_t i = 0; i < robots.size(); ++i)
    {
        x_m[i] = robots[i].x_m;
        y_m[i] = robots[i].y_m;
    }
    const Each begun = Factors(x_m, y_m, robots.size(), v);
    for (size_t i = 0; i < robots.size(); ++i)
    {
        const GroundSignals &s = robots[i];
        const double half_s = s.dt_s / 2 * begun[i];
        const auto [c, d] = s.AheadAfter(half_s / 2);
        x_m[i] += half_s * (c * s.vx_mps - d * s.vy_mps);
        y_m[i] += half_s * (d * s.vx_mps + c * s.vy_mps);
    }
    const Each middle = Factors(x_m, y_m, robots.size(), v);
    for (size_t i = 0; i < robots.size(); ++i)
    {
        robots[i].vx_mps *= middle[i];
        robots[i].vy_mps *= middle[i];
        robots[i].omega_radps *= middle[i];
    }
}

void Steps(std::span<GroundSignals> robots, const Numbers &v)
{
    for (; v[0] != 0 && !robots.empty();
         robots = robots.subspan(std::min(kTogether, robots.size())))
        Some(robots.first(std::min(kTogether, robots.size())), v);
}

void Step(GroundSignals &s, const Numbers &v, double *)
{
    Steps({&s, 1}, v);
}

}  // namespace

EFFECT(floor_patch) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{Step, Steps},
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"
#include "effects/together.h"

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

// Of `count` places. (1 - tanh(u)) / 2 is 1 / (1 + exp(2 u)).
Each Factors(const Each &x_m, const Each &y_m, size_t count, const Numbers &v)
{
    const double strength = v[0], middle_x_m = v[1], middle_y_m = v[2], radius_m = v[3];
    Each factors{};
    for (size_t i = 0; i < count; ++i)
    {
        const double dx_m = x_m[i] - middle_x_m, dy_m = y_m[i] - middle_y_m;
        factors[i] = 2 / kEdge_m * (std::sqrt(dx_m * dx_m + dy_m * dy_m) - radius_m);
    }
    for (size_t i = 0; i < count; ++i)
        factors[i] = std::exp(factors[i]);
    for (size_t i = 0; i < count; ++i)
        factors[i] = 1 - strength / (1 + factors[i]);
    return factors;
}

// Takes the factor at the middle of the step's way: right to second order.
void Steps(EachGround &robots, const Numbers &v)
{
    if (v[0] == 0)
        return;
    const EachPose &pose = robots.pose;
    const Each begun = Factors(pose.x_m, pose.y_m, robots.count, v);
    Each half_s{}, turned_rad{}, x_m{}, y_m{};
    for (size_t i = 0; i < robots.count; ++i)
    {
        half_s[i] = robots.dt_s / 2 * begun[i];
        turned_rad[i] = robots.omega_radps[i] * (half_s[i] / 2);
    }
    const Turns turns(turned_rad, robots.count);
    for (size_t i = 0; i < robots.count; ++i)
    {
        const Direction turn{turns.cos[i], turned_rad[i] * turns.sin_over[i]};
        const auto [c, d] = Direction{pose.c[i], pose.s[i]}.Turned(turn);
        x_m[i] = pose.x_m[i] + half_s[i] * (c * robots.vx_mps[i] - d * robots.vy_mps[i]);
        y_m[i] = pose.y_m[i] + half_s[i] * (d * robots.vx_mps[i] + c * robots.vy_mps[i]);
    }
    const Each middle = Factors(x_m, y_m, robots.count, v);
    for (size_t i = 0; i < robots.count; ++i)
    {
        robots.vx_mps[i] *= middle[i];
        robots.vy_mps[i] *= middle[i];
        robots.omega_radps[i] *= middle[i];
    }
}

void Step(GroundSignals &s, const Numbers &v, double *)
{
    const EachPose pose{{s.x_m}, {s.y_m}, {s.theta_rad}, {s.ahead.c}, {s.ahead.s}};
    EachGround alone{s.robot, s.t_s,      s.dt_s,     s.moves,        pose,
                     1,       {s.vx_mps}, {s.vy_mps}, {s.omega_radps}};
    Steps(alone, v);
    s.vx_mps = alone.vx_mps[0];
    s.vy_mps = alone.vy_mps[0];
    s.omega_radps = alone.omega_radps[0];
}

}  // namespace

EFFECT(floor_patch) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{Step, Steps},
};

}  // namespace twin

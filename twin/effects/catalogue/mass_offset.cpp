// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "mass_offset",
    .drives = kAnyDrive,
    .summary =
        "The floor's drag acts beside the wheels' centre: turning pulls the robot along, "
        "driving turns it.",
    .equation =
        "vx' = vx + y omega, vy' = vy - x omega, omega' = omega - (x vy - y vx) / (0.1 m)^2",
    .leaves_out =
        "inertia when starting and stopping; the floor's drag itself, which is the base "
        "gains'",
    .measure =
        "turns on the spot and straight drives forward and sideways; turns alone show "
        "marker_offset, with the sign reversed, and straight drives alone wheel_gain",
    .reference =
        "viscous creep of the wheels against drag at the centre of mass, to first order in "
        "slip; creep law as in Pacejka 2012, Tire and Vehicle Dynamics",
    .family = Family::kGeometry,
    .needs = Needs::kSteadySpeed,
    .phrase = "the weight is off the centre of the wheels",
    .identify = kStraight | kStrafe | kSpin,
};

constexpr ParameterSpec kParameters[] = {
    {"x_m", "m", 0, 0.002, -0.05, 0.05,
     "centre of mass ahead of the wheels' centre, times the share of speed lost to slip",
     "weight ahead of the centre", "weight behind the centre"},
    {"y_m", "m", 0, 0.002, -0.05, 0.05,
     "centre of mass left of the wheels' centre, times the same share", "weight left of the centre",
     "weight right of the centre"},
};

// With which the wheels' creep resists turning.
constexpr double kArm_m = 0.1;

void Step(GroundSignals &s, const Numbers &v, double *)
{
    const double x_m = v[0], y_m = v[1], omega_radps = s.omega_radps;
    s.omega_radps -= (x_m * s.vy_mps - y_m * s.vx_mps) / (kArm_m * kArm_m);
    s.vx_mps += y_m * omega_radps;
    s.vy_mps -= x_m * omega_radps;
}

}  // namespace

EFFECT(mass_offset) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{Step},
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "strafe_loss",
    .drives = kAnyDrive,
    .summary = "Sideways speed is lost when the robot drives forward meanwhile.",
    .equation = "vy' = vy (1 - loss sin(2 a)^2), a the direction of travel in the robot's frame",
    .leaves_out =
        "loss in purely sideways motion, which is base.sideways_gain's; bumps of single "
        "rollers",
    .measure =
        "drives at 30, 45 and 60 degrees to the heading; with one robot heading carpet_grain "
        "looks alike",
    .reference =
        "on a diagonal two mecanum wheels stand and drag their rollers; Tlale and de Villiers"
        " 2008, Kinematics and dynamics modelling of a mecanum wheeled mobile platform",
    .family = Family::kFriction,
    .needs = Needs::kSteadySpeed,
    .phrase = "loses sideways speed on diagonals",
    .identify = kDiagonal,
};

constexpr ParameterSpec kParameters[] = {
    {"loss", "1", 0, 0.1, -1, 1, "relative loss of sideways speed at 45 degrees",
     "loses sideways speed on diagonals", "gains sideways speed on diagonals"},
};

void Step(GroundSignals &s, const Numbers &v, double *)
{
    const double squared = s.vx_mps * s.vx_mps + s.vy_mps * s.vy_mps;
    if (squared <= 0)
        return;
    const double sin2 = 2 * s.vx_mps * s.vy_mps / squared;
    s.vy_mps *= 1 - v[0] * sin2 * sin2;
}

}  // namespace

EFFECT(strafe_loss) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{Step},
};

}  // namespace twin

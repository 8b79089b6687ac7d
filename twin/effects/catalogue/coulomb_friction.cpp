// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "coulomb_friction",
    .drives = kAnyDrive,
    .summary = "Friction takes the same speed from the robot however fast it travels.",
    .equation =
        "v' = v (1 - loss tanh(|v| / w) / |v|), w^2 = loss^2 + (0.02 m/s)^2, v = (vx, vy): |v| - "
        "loss in the direction of travel, less near rest",
    .leaves_out = "friction against turning; different friction along and across the robot",
    .measure =
        "straight drives at five or more speeds, forward and sideways, and turns; on straight"
        " drives dead_zone looks alike where speed is proportional to duty",
    .reference = "Olsson et al. 1998, Friction models and friction compensation",
    .family = Family::kFriction,
    .needs = Needs::kSteadySpeed,
    .phrase = "friction takes a fixed speed away",
    .identify = kStraight | kStrafe | kSpin | kLevels,
};

constexpr ParameterSpec kParameters[] = {
    {"loss_mps", "m/s", 0, 0.012, 0, 0.3, "speed lost when travelling much faster than that",
     "too slow by the same at all speeds", "too fast by the same at all speeds"},
};

// Below it friction fades, so that it never turns the motion round and fits see no kink.
constexpr double kFade_mps = 0.02;

void Step(GroundSignals &s, const Numbers &v, double *)
{
    const double loss_mps = v[0], speed_mps = std::hypot(s.vx_mps, s.vy_mps);
    if (loss_mps <= 0 || speed_mps <= 0)
        return;
    const double lost_mps = loss_mps * std::tanh(speed_mps / std::hypot(loss_mps, kFade_mps));
    const double kept = 1 - lost_mps / speed_mps;
    s.vx_mps *= kept;
    s.vy_mps *= kept;
}

}  // namespace

EFFECT(coulomb_friction) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{Step},
};

}  // namespace twin

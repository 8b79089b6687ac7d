// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "wheel_eccentricity",
    .stage = Stage::kWheel,
    .drives = kAnyDrive,
    .summary =
        "A wheel that is not round, or not centred, rolls faster and slower once in each "
        "turn.",
    .equation =
        "way = rim way (1 + cos_k cos(phi_k) + sin_k sin(phi_k)), phi_k the wheel's angle "
        "since the start of the log",
    .leaves_out = "ripple of single rollers; slip, which makes the angle of a long log uncertain",
    .measure =
        "slow straight drives of several turns of the wheels in one log; the mean over a turn"
        " is wheel_gain's",
    .reference = "instantaneous radius of an eccentric disc, to first order",
    .family = Family::kGeometry,
    .needs = Needs::kWheelAngle,
    .phrase = "a wheel is not round",
    .identify = kStraight | kLong,
};

constexpr Parameter kParameters[] = {
    {"fl_cos", "1", 0, 0.02, -0.3, 0.3, "front left wheel: relative rise of its radius at angle 0",
     "front left wheel larger at its starting angle",
     "front left wheel smaller at its starting angle"},
    {"fl_sin", "1", 0, 0.02, -0.3, 0.3,
     "front left wheel: relative rise of its radius at angle 90 degrees",
     "front left wheel larger a quarter turn on", "front left wheel smaller a quarter turn on"},
    {"fr_cos", "1", 0, 0.02, -0.3, 0.3, "front right wheel: relative rise of its radius at angle 0",
     "front right wheel larger at its starting angle",
     "front right wheel smaller at its starting angle"},
    {"fr_sin", "1", 0, 0.02, -0.3, 0.3,
     "front right wheel: relative rise of its radius at angle 90 degrees",
     "front right wheel larger a quarter turn on", "front right wheel smaller a quarter turn on"},
    {"rl_cos", "1", 0, 0.02, -0.3, 0.3, "rear left wheel: relative rise of its radius at angle 0",
     "rear left wheel larger at its starting angle",
     "rear left wheel smaller at its starting angle"},
    {"rl_sin", "1", 0, 0.02, -0.3, 0.3,
     "rear left wheel: relative rise of its radius at angle 90 degrees",
     "rear left wheel larger a quarter turn on", "rear left wheel smaller a quarter turn on"},
    {"rr_cos", "1", 0, 0.02, -0.3, 0.3, "rear right wheel: relative rise of its radius at angle 0",
     "rear right wheel larger at its starting angle",
     "rear right wheel smaller at its starting angle"},
    {"rr_sin", "1", 0, 0.02, -0.3, 0.3,
     "rear right wheel: relative rise of its radius at angle 90 degrees",
     "rear right wheel larger a quarter turn on", "rear right wheel smaller a quarter turn on"},
};

class WheelEccentricity final : public Effect
{
public:
    explicit WheelEccentricity(std::span<const double> v)
        : cos_{v[0], v[2], v[4], v[6]}, sin_{v[1], v[3], v[5], v[7]}
    {
    }

    // Mean over the step's part of a turn: exact at constant speed, second order while it changes.
    void Step(Signals &s, double *) const override
    {
        for (int k = 0; k < kWheels; ++k)
        {
            const double reached = s.dt_s / (s.dt_s + 2 * s.tau_s[k]);
            const double mean_mps = s.rim_mps[k] + (s.target_mps[k] - s.rim_mps[k]) * reached;
            const double half_rad = mean_mps * s.dt_s / (2 * s.wheel_radius_m);
            const double chord = std::abs(half_rad) > 1e-6 ? std::sin(half_rad) / half_rad : 1;
            const double middle_rad = s.wheel_rad[k] + half_rad;
            s.roll[k] *=
                1 + chord * (cos_[k] * std::cos(middle_rad) + sin_[k] * std::sin(middle_rad));
        }
    }

private:
    Wheels cos_, sin_;
};

}  // namespace

extern const EffectSpec kWheelEccentricity;
const EffectSpec kWheelEccentricity = {kCard, kParameters, Make<WheelEccentricity>};

}  // namespace twin

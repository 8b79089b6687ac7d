// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "floor_tilt",
    .stage = Stage::kGround,
    .drives = kAnyDrive,
    .summary = "The robot creeps in one direction of the room while it moves.",
    .equation = "v_W' = v_W + drift while any wheel turns",
    .leaves_out = "dependence of the creep on speed and load",
    .measure = "the same drives along four headings",
    .reference =
        "Scheding et al. 1999, An experiment in autonomous navigation of an underground mining vehicle (slip on slopes)",
    .family = Family::kPlace,
    .needs = Needs::kRoom,
    .phrase = "creeps in one direction of the room",
    .identify = kStraight | kHeadings,
};

constexpr Parameter kParameters[] = {
    {"drift_x_mps", "m/s", 0, 0.005, -0.2, 0.2, "creep along x of W",
     "creeps towards x of the room", "creeps against x of the room"},
    {"drift_y_mps", "m/s", 0, 0.005, -0.2, 0.2, "creep along y of W",
     "creeps towards y of the room", "creeps against y of the room"},
};

class FloorTilt final : public Effect
{
public:
    explicit FloorTilt(std::span<const double> v) : drift_x_mps_(v[0]), drift_y_mps_(v[1]) {}

    void Step(Signals &s, double *) const override
    {
        if (!s.moves)
            return;
        const double heading_rad = s.theta_rad + s.omega_radps * s.dt_s / 2;
        const double c = std::cos(heading_rad), d = std::sin(heading_rad);
        s.vx_mps += c * drift_x_mps_ + d * drift_y_mps_;
        s.vy_mps += -d * drift_x_mps_ + c * drift_y_mps_;
    }

private:
    double drift_x_mps_, drift_y_mps_;
};

}  // namespace

extern const EffectSpec kFloorTilt;
const EffectSpec kFloorTilt = {kCard, kParameters, Make<FloorTilt>};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "slew_limit",
    .stage = Stage::kDuty,
    .drives = kDutyOnly,
    .summary = "The motor driver changes duty only gradually.",
    .equation = "|du'/dt| <= 1 / ramp, u' tends to u",
    .leaves_out = "different ramps up and down",
    .measure =
        "single steps of several sizes from rest, up and down; at one size motor_lag and "
        "input_delay look alike",
    .reference =
        "rate limiter as in motor drivers' acceleration ramps; Franklin et al. 2010, Feedback"
        " Control of Dynamic Systems",
    .family = Family::kTransient,
    .needs = Needs::kChanges,
    .phrase = "commands are ramped",
    .identify = kSteps | kLevels,
};

constexpr Parameter kParameters[] = {
    {"ramp_s", "s", 0, 0.1, 0, 2, "time from rest to full duty; 0: no limit", "commands are ramped",
     "commands are not ramped"},
};

// What the driver put out at time state[0], and what it was told then. A later effect may cut the
// step: how far the ramp got is known only when the next one begins.
class SlewLimit final : public Effect
{
public:
    explicit SlewLimit(std::span<const double> v) : ramp_s_(v[0]) {}

    int StateSize() const override { return ramp_s_ > 0 ? 1 + 2 * kWheels : 0; }

    void Step(Signals &s, double *state) const override
    {
        if (ramp_s_ <= 0)
            return;
        const double change = std::max(0.0, s.t_s - state[0]) / ramp_s_;
        state[0] = s.t_s;
        double *out = state + 1, *told = out + kWheels;
        for (int k = 0; k < kWheels; ++k)
        {
            out[k] += std::clamp(told[k] - out[k], -change, change);
            told[k] = s.duty[k];
            s.duty[k] = Mean(out[k], told[k], s.dt_s);
        }
    }

private:
    // Over a step of a ramp that begins at `out`.
    double Mean(double out, double told, double dt_s) const
    {
        const double ramp_s = std::abs(told - out) * ramp_s_;
        if (ramp_s <= dt_s)
            return told - (told - out) * ramp_s / (2 * dt_s);
        return out + std::copysign(dt_s / (2 * ramp_s_), told - out);
    }

    double ramp_s_;
};

}  // namespace

extern const EffectSpec kSlewLimit;
const EffectSpec kSlewLimit = {kCard, kParameters, Make<SlewLimit>};

}  // namespace twin

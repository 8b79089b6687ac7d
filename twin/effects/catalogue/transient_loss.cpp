// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "transient_loss",
    .drives = kAnyDrive,
    .summary = "For a while the wheels bring less, and then as much as before.",
    .equation =
        "v' = v (1 - loss w), w = 1 / (1 + exp(-(t - from) / edge)) - "
        "1 / (1 + exp(-(t - until) / edge)); t since the log's first command",
    .leaves_out = "what comes more than once; sides that lose differently; times of several logs",
    .measure =
        "drives that come by the same places at several times: a floor does the same to one visit",
    .reference = "transient fault of an actuator; Isermann 2006, Fault-Diagnosis Systems",
    .family = Family::kPower,
    .needs = Needs::kHistory,
    .phrase = "slower for a while",
    .identify = kStraight | kLong,
};

constexpr ParameterSpec kParameters[] = {
    {"loss", "1", 0, 0.1, -1, 0.95, "relative loss of way in that time, all wheels",
     "slower for a while", "faster for a while"},
    {"from_s", "s", 0, 1, 0, 100000, "since the log's first command; means nothing at no loss", "",
     "", 3, Role::kMoment},
    {"until_s", "s", 100000, 6, 0, 100000, "when all is as before again; means nothing at no loss",
     "", "", 3, Role::kMoment},
    {"edge_s", "s", kAtOnce_s, kAtOnce_s, kAtOnce_s, kSlowest_s,
     "how gradual the change is: 0.1 s is at once; means nothing at no loss", "", "", 3,
     Role::kDuration},
};

void Step(RollSignals &s, const Numbers &v, double *)
{
    if (v[0] == 0)
        return;
    const double t_s = s.t_s + s.dt_s / 2;
    const double whole = Begun(t_s - v[1], v[3]) - Begun(t_s - v[2], v[3]);
    for (int k = 0; k < s.robot.wheels; ++k)
        s.radius_ratio[k] *= 1 - v[0] * whole;
}

}  // namespace

EFFECT(transient_loss) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnRolling{Step},
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "abrupt_loss",
    .drives = kAnyDrive,
    .summary = "From one moment on the wheels bring less, those of one side perhaps more so.",
    .equation =
        "v' = v (1 - (loss + side s) w), w = 1 / (1 + exp(-(t - from) / edge)), s = 1 for left "
        "wheels, -1 for right ones, 0 in the middle; t since the log's first command",
    .leaves_out = "what comes and goes; more than one moment; moments of several logs",
    .measure =
        "one long drive that comes by the same places before and after: a floor that is left for "
        "good does the same",
    .reference =
        "loss of effectiveness of actuators, abrupt fault; Isermann 2006, Fault-Diagnosis Systems",
    .family = Family::kPower,
    .needs = Needs::kHistory,
    .phrase = "slower from one moment on",
    .identify = kStraight | kLong,
};

constexpr ParameterSpec kParameters[] = {
    {"loss", "1", 0, 0.1, -1, 0.95, "relative loss of way after the moment, all wheels",
     "slower from one moment on", "faster from one moment on"},
    {"side", "1", 0, 0.02, -1, 1, "what left wheels lose more, and right ones less",
     "left wheels weaker from one moment on", "right wheels weaker from one moment on", 0.1},
    {"from_s", "s", 0, 1, 0, 100000, "since the log's first command; means nothing at no loss", "",
     "", 3, Role::kMoment},
    {"edge_s", "s", kAtOnce_s, kAtOnce_s, kAtOnce_s, kSlowest_s,
     "how gradual the change is: 0.1 s is at once; means nothing at no loss", "", "", 3,
     Role::kDuration},
};

void Step(RollSignals &s, const Numbers &v, double *)
{
    if (v[0] == 0 && v[1] == 0)
        return;
    const double whole = Begun(s.t_s + s.dt_s / 2 - v[2], v[3]);
    for (int k = 0; k < s.robot.wheels; ++k)
        s.radius_ratio[k] *= 1 - (v[0] + v[1] * s.robot.left[k]) * whole;
}

}  // namespace

EFFECT(abrupt_loss) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnRolling{Step},
};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "effects/effect.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "collision",
    .drives = kAnyDrive,
    .summary = "Bodies touch earlier or later than the model says, and rub against each other.",
    .equation = "r' = max(0, r + radius); |tangential shift| <= friction * normal shift",
    .leaves_out =
        "bouncing, and the turn that rubbing gives a body; planar plant: who pushes harder",
    .measure = "two robots that drive into each other, head on and past each other",
    .reference =
        "Coulomb friction in position-based dynamics: Macklin et al. 2014, ACM Transactions on Graphics 33(4) 153",
    .family = Family::kContact,
    .needs = Needs::kContacts,
    .phrase = "robots touch at another distance",
    .identify = kTwoRobots,
};

constexpr ParameterSpec kParameters[] = {
    {"radius_m", "m", 0, 0.01, -0.2, 0.2, "added to the body's radius", "touches earlier",
     "touches later"},
    {"friction", "1", 0, 0.3, 0, 2,
     "added to the coefficient between two bodies, of which the larger counts", "bodies rub",
     "bodies slide past"},
};

void Set(Body &b, const Numbers &v)
{
    b.radius_m = std::max(0.0, b.radius_m + v[0]);
    b.friction += v[1];
}

}  // namespace

EFFECT(collision) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnBody{Set},
};

}  // namespace twin

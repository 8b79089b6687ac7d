// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

constexpr double kLimit_mps = 0.5;

Model Told()
{
    Model model;
    model.base.drive = Drive::kTwist;
    model.base.wheels = WheelKind::kDifferential;
    return model;
}

Player Limited()
{
    return Player(With("wheel_limit", {1 / kLimit_mps}, Told()), 0.02);
}

// Wheels at v -+ omega b: the outer one is cut to the limit, and the body moves by the mean of both
// and turns by half of what is between them, over b.
TEST(WheelLimit, CutsTheOuterWheelOfACurve)
{
    const double half_track_m = Told().robot.half_track_m, inner_mps = 0.4 - 3 * half_track_m;
    ASSERT_GT(0.4 + 3 * half_track_m, kLimit_mps);
    Player player = Limited();
    player.Play({0.4, 0, 3}, 0.02);
    EXPECT_NEAR(player.state.vx_mps, (kLimit_mps + inner_mps) / 2, 1e-12);
    EXPECT_NEAR(player.state.omega_radps, (kLimit_mps - inner_mps) / (2 * half_track_m), 1e-12);
}

TEST(WheelLimit, LeavesSlowerWheelsAsTheyAre)
{
    Player player = Limited();
    player.Play({-0.3, 0, 0.5}, 0.02);
    EXPECT_NEAR(player.state.vx_mps, -0.3, 1e-12);
    EXPECT_NEAR(player.state.omega_radps, 0.5, 1e-12);
}

TEST(WheelLimit, IsRefusedWhereNoWheelsAreKnown)
{
    Model model = Told();
    model.base.wheels = WheelKind::kNone;
    EXPECT_THROW(model.AddEffect("wheel_limit"), std::invalid_argument);
}

}  // namespace
}  // namespace twin::test

// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

double TauAfter(double tau_s, double extra_s, double duty)
{
    Signals s;
    s.duty.fill(duty);
    s.tau_s.fill(tau_s);
    MakeAlone("lag_by_duty", {extra_s}).Step(s, nullptr);
    return s.tau_s[3];
}

TEST(LagByDuty, AddsItsWholeAtRestAndNothingAtFullDuty)
{
    EXPECT_DOUBLE_EQ(TauAfter(0.04, 0.14, 0), 0.18);
    EXPECT_DOUBLE_EQ(TauAfter(0.04, 0.14, 0.5), 0.11);
    EXPECT_DOUBLE_EQ(TauAfter(0.04, 0.14, -0.5), 0.11);
    EXPECT_DOUBLE_EQ(TauAfter(0.04, 0.14, 1), 0.04);
    EXPECT_DOUBLE_EQ(TauAfter(0.04, 0.14, -1), 0.04);
}

TEST(LagByDuty, NeverGoesBelowZero)
{
    EXPECT_EQ(TauAfter(0.04, -0.5, 0), 0);
    EXPECT_DOUBLE_EQ(TauAfter(0.04, -0.02, 0.5), 0.03);
}

// First order from rest: x(t) = v (t - tau (1 - exp(-t / tau))), with the tau of that duty.
TEST(LagByDuty, GivesEachDutyItsOwnStepResponse)
{
    for (const double duty : {0.3, 0.6, 1.0, -0.6})
    {
        Player player(With("lag_by_duty", {0.14}, Lagging(0.04)), 0.02);
        player.Play(Scaled(kForward, duty), 0.2);
        const double tau_s = 0.04 + 0.14 * (1 - std::abs(duty)), v_mps = duty * kFull_mps;
        EXPECT_NEAR(player.state.pose.x_m, v_mps * (0.2 - tau_s * (1 - std::exp(-0.2 / tau_s))),
                    1e-12);
    }
}

}  // namespace
}  // namespace twin::test

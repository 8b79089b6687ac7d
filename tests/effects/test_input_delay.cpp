// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

// A step at t = 0 through a delay: x(t) = v max(0, t - delay), whatever part of a step it is.
TEST(InputDelay, ShiftsAStepByExactlyTheDelay)
{
    for (const double delay_s : {1e-4, 0.013, 0.02, 0.05, 0.1234, 0.3})
        for (const double dt_s : {0.005, 0.02, 0.033})
        {
            Player player(With("input_delay", {delay_s}), dt_s);
            for (int step = 1; step < 40; ++step)
            {
                player.Play(kForward, dt_s);
                EXPECT_NEAR(player.state.pose.x_m, kFull_mps * std::max(0.0, step * dt_s - delay_s),
                            1e-12)
                    << delay_s << " s in steps of " << dt_s << " s";
            }
        }
}

// A pulse keeps its area, also when it is shorter than the delay.
TEST(InputDelay, KeepsTheWayOfAPulse)
{
    Player player(With("input_delay", {0.29}), 0.02);
    player.Play(kForward, 0.04);
    player.Play(kStop, 0.1);
    player.Play(Scaled(kForward, 0.5), 0.06);
    player.Play(kStop, 0.5);
    EXPECT_NEAR(player.state.pose.x_m, kFull_mps * (0.04 + 0.5 * 0.06), 1e-12);
    EXPECT_NEAR(player.state.rim_mps[0], 0, 1e-12);
}

// 60 steps of 5 ms are the longest delay: the command of 60 steps ago comes out.
TEST(InputDelay, RemembersANewCommandEveryFiveMilliseconds)
{
    const auto effect = FindEffect("input_delay")->make(std::vector<double>{0.3});
    std::vector<double> state(static_cast<size_t>(effect->StateSize()), 0.0);
    for (int step = 0; step < 500; ++step)
    {
        Signals s;
        s.t_s = 0.005 * step;
        s.dt_s = 0.005;
        s.duty.fill(1e-3 * step);
        effect->Step(s, state.data());
        EXPECT_NEAR(s.duty[2], std::max(0.0, 1e-3 * (step - 60)), 1e-12) << step;
    }
}

TEST(InputDelay, DelaysEachWheelsOwnCommand)
{
    const auto effect = FindEffect("input_delay")->make(std::vector<double>{0.03});
    std::vector<double> state(static_cast<size_t>(effect->StateSize()), 0.0);
    Signals s;
    for (int step = 0; step < 2; ++step)
    {
        s.t_s = 0.02 * step;
        s.dt_s = 0.02;
        s.duty = {1, -1, 0.5, 0};
        effect->Step(s, state.data());
    }
    const Wheels half{0.5, -0.5, 0.25, 0};  // the step from 20 to 40 ms sees it from 30 ms on
    for (size_t k = 0; k < kWheels; ++k)
        EXPECT_NEAR(s.duty[k], half[k], 1e-12);
}

TEST(InputDelay, DelaysVelocityCommandsToo)
{
    Model model;
    model.base.drive = Drive::kTwist;
    Player player(With("input_delay", {0.05}, model), 0.02);
    player.Play({0.2, 0.1, 0, 0}, 1);
    EXPECT_NEAR(player.state.pose.x_m, 0.2 * 0.95, 1e-12);
    EXPECT_NEAR(player.state.pose.y_m, 0.1 * 0.95, 1e-12);
}

}  // namespace
}  // namespace twin::test

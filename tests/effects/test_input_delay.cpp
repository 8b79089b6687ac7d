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
    const auto effect = MakeAlone("input_delay", {0.3});
    std::vector<double> state(static_cast<size_t>(effect.StateSize()), 0.0);
    for (int step = 0; step < 500; ++step)
    {
        Signals s;
        s.t_s = 0.005 * step;
        s.dt_s = 0.005;
        s.duty.fill(1e-3 * step);
        effect.Step(s, state.data());
        EXPECT_NEAR(s.duty[2], std::max(0.0, 1e-3 * (step - 60)), 1e-12) << step;
    }
}

// Given from 0 to 20 ms, it arrives at 30 ms: the step from 20 ms on is cut there.
TEST(InputDelay, CutsTheStepWhereACommandArrives)
{
    const auto effect = MakeAlone("input_delay", {0.03});
    std::vector<double> state(static_cast<size_t>(effect.StateSize()), 0.0);
    const Wheels command{1, -1, 0.5, 0};
    const struct
    {
        double t_s, dt_s, cut_s;
        Wheels duty;
    } steps[] = {{0, 0.02, 0.02, {}}, {0.02, 0.02, 0.01, {}}, {0.03, 0.01, 0.01, command}};
    for (const auto &step : steps)
    {
        Signals s;
        s.t_s = step.t_s;
        s.dt_s = step.dt_s;
        s.duty = command;
        effect.Step(s, state.data());
        EXPECT_EQ(s.duty, step.duty) << step.t_s;
        EXPECT_NEAR(s.dt_s, step.cut_s, 1e-15) << step.t_s;
    }
}

TEST(InputDelay, TwoInARowAddUp)
{
    Player player(With("input_delay", {0.033}, With("input_delay", {0.05})), 0.02);
    player.Play(kForward, 1);
    player.Play(kStop, 0.08);
    EXPECT_NEAR(player.state.pose.x_m, kFull_mps * 0.997, 1e-12);
}

// Rolls on at full speed for the delay, then as without it.
TEST(InputDelay, PutsOffAStopWithoutChangingIt)
{
    for (const double delay_s : {0.04, 0.0421, 0.05, 0.059})
    {
        Player coasting(With("coasting", {0.7}, With("input_delay", {delay_s})), 0.02);
        Player lagging(With("input_delay", {delay_s}, Lagging(0.05)), 0.02);
        for (Player *player : {&coasting, &lagging})
        {
            player->Play(kForward, 2);
            const double start_m = player->state.pose.x_m;
            player->Play(kStop, 2);
            const double roll_m =
                player == &coasting ? kFull_mps * kFull_mps / (2 * 0.7) : kFull_mps * 0.05;
            EXPECT_NEAR(player->state.pose.x_m - start_m, kFull_mps * delay_s + roll_m, 1e-12);
        }
    }
}

TEST(InputDelay, LeavesTheDeadZoneItsWidth)
{
    Player player(With("dead_zone", {0.3}, With("input_delay", {0.05})), 0.02);
    player.Play(Scaled(kForward, 0.5), 1);
    EXPECT_NEAR(player.state.pose.x_m, 0.2 * kFull_mps * 0.95, 1e-12);
}

// A new command every millisecond overruns what it remembers: late or early, but never lost.
TEST(InputDelay, KeepsDrivingWhenCommandsComeTooFast)
{
    const auto effect = MakeAlone("input_delay", {0.3});
    std::vector<double> state(static_cast<size_t>(effect.StateSize()), 0.0);
    Signals s;
    for (int step = 0; step < 1000; ++step)
    {
        s.t_s = 1e-3 * step;
        s.dt_s = 1e-3;
        s.duty.fill(0.5 + 1e-4 * step);
        effect.Step(s, state.data());
    }
    EXPECT_GT(s.duty[0], 0.5);
    EXPECT_EQ(s.dt_s, 1e-3);
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

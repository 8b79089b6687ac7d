// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

constexpr double kLag_s = 0.08;

// First order from rest with its own time constant, at any step.
TEST(YawLag, GivesTurningItsOwnTimeConstant)
{
    for (const double extra_s : {-0.05, 0.04})
        for (const double dt_s : {0.004, 0.022, 0.1})
        {
            Player player(With("yaw_lag", {extra_s}, Lagging(kLag_s)), dt_s);
            for (int step = 1; step < 20; ++step)
            {
                player.Play(kTurnLeft, dt_s);
                const double part = 1 - std::exp(-step * dt_s / (kLag_s + extra_s));
                EXPECT_NEAR(player.state.rim_mps[1], kFull_mps * part, 1e-12);
                EXPECT_NEAR(player.state.rim_mps[0], -kFull_mps * part, 1e-12);
            }
        }
}

TEST(YawLag, LeavesDrivingAsItIs)
{
    for (const Wheels &command : {kForward, kStrafeLeft})
    {
        Player with(With("yaw_lag", {-0.05}, Lagging(kLag_s)), 0.02), plain(Lagging(kLag_s), 0.02);
        for (Player *player : {&with, &plain})
            player->Play(command, 0.3);
        EXPECT_NEAR(with.state.pose.x_m, plain.state.pose.x_m, 1e-12);
        EXPECT_NEAR(with.state.pose.y_m, plain.state.pose.y_m, 1e-12);
    }
}

// An arc is the sum of both: the left wheel has v (1 - e1) - w (1 - e2).
TEST(YawLag, PartsAnArcIntoDrivingAndTurning)
{
    Player player(With("yaw_lag", {-0.03}, Lagging(kLag_s)), 0.02);
    player.Play({0.5, 1, 0.5, 1}, 0.1);
    const double drive = 1 - std::exp(-0.1 / kLag_s), turn = 1 - std::exp(-0.1 / 0.05);
    EXPECT_NEAR(player.state.rim_mps[0], kFull_mps * (0.75 * drive - 0.25 * turn), 1e-12);
    EXPECT_NEAR(player.state.rim_mps[1], kFull_mps * (0.75 * drive + 0.25 * turn), 1e-12);
}

// The angle after a step of the command is rate (t - tau) once the lag has passed.
TEST(YawLag, TurnsAsFarAsItsTimeConstantSays)
{
    Player player(With("yaw_lag", {-0.04}, Lagging(kLag_s)), 0.002);
    player.Play(kTurnLeft, 1);
    const double rate_radps = player.state.omega_radps;
    EXPECT_NEAR(player.state.pose.theta_rad, rate_radps * (1 - 0.04), 1e-3 * rate_radps);
}

// The wheels' lag is a sum, whatever stands first in the model file.
TEST(YawLag, SplitsTheLagThatAllOthersLeave)
{
    const Model before = With("motor_lag", {0.04}, With("yaw_lag", {-0.05}, Lagging(kLag_s)));
    const Model after = With("yaw_lag", {-0.05}, With("motor_lag", {0.04}, Lagging(kLag_s)));
    for (const Model &model : {before, after})
    {
        Player player(model, 0.02);
        player.Play(kTurnLeft, 0.1);
        EXPECT_NEAR(player.state.rim_mps[1], kFull_mps * (1 - std::exp(-0.1 / 0.07)), 1e-12);
    }
}

// The difference that a second log tells of stands beside the first log's number.
TEST(YawLag, AddsToTheOneThatTheModelHas)
{
    const Model twice = With("yaw_lag", {0.06}, With("yaw_lag", {-0.05}, Lagging(kLag_s)));
    for (const double dt_s : {0.004, 0.022, 0.1})
    {
        Player player(twice, dt_s);
        player.Play(kTurnLeft, dt_s);
        EXPECT_NEAR(player.state.rim_mps[1], kFull_mps * (1 - std::exp(-dt_s / 0.09)), 1e-12);
    }
}

// Two events may lie nearer to each other than exp() can tell: nothing moves, and all stays finite.
TEST(YawLag, HoldsThroughAStepTooShortToSee)
{
    constexpr double dt_s = 1e-18;
    Player player(With("yaw_lag", {-0.03}, Lagging(kLag_s)), dt_s);
    player.Play(kTurnLeft, dt_s);
    EXPECT_NEAR(player.state.rim_mps[1], 0, 1e-12);
}

// Two lags in a row, a and b, answer a step by 1 - (a exp(-t/a) - b exp(-t/b)) / (a - b).
TEST(YawLag, ComesBehindAFilterBeforeTheMotors)
{
    constexpr double kFilter_s = 0.03, kTurn_s = kLag_s - 0.03, dt_s = 1e-4, t_s = 0.1;
    for (const Model &model :
         {With("second_order_lag", {kFilter_s}, With("yaw_lag", {-0.03}, Lagging(kLag_s))),
          With("yaw_lag", {-0.03}, With("second_order_lag", {kFilter_s}, Lagging(kLag_s)))})
    {
        Player player(model, dt_s);
        player.Play(kTurnLeft, t_s);
        const double left =
            kTurn_s * std::exp(-t_s / kTurn_s) - kFilter_s * std::exp(-t_s / kFilter_s);
        const double part = 1 - left / (kTurn_s - kFilter_s);
        EXPECT_NEAR(player.state.rim_mps[1], kFull_mps * part, 1e-3 * kFull_mps);
    }
}

}  // namespace
}  // namespace twin::test

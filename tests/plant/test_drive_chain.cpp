// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <numeric>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(DriveChain, InterpolatesItsDutyTableOddInDuty)
{
    Model model;
    model.base.duty_pct = {0, 20, 60, 100};
    model.base.wheel_speed_mps = {0, 0.02, 0.3, 0.4};
    const std::pair<double, double> expected[] = {
        {0, 0}, {0.1, 0.01}, {0.2, 0.02}, {0.4, 0.16}, {0.8, 0.35}, {1, 0.4}, {1.5, 0.4}};
    for (const auto &[duty, speed_mps] : expected)
        for (const double sign : {1.0, -1.0})
        {
            Player player(model, 0.02);
            player.Play(Scaled(kForward, sign * duty), 0.02);
            EXPECT_NEAR(player.state.rim_mps[3], sign * speed_mps, 1e-15) << duty;
        }
}

TEST(DriveChain, TurnsMeasuredWheelSpeedsIntoRimSpeeds)
{
    Model model;
    model.base.drive = Drive::kWheelSpeed;
    Player player(model, 0.02);
    player.Play({10, 10, 10, 10}, 1);
    EXPECT_NEAR(player.state.pose.x_m, 10 * model.robot.wheel_radius_m, 1e-12);
}

// A wheel that has rolled x through its lag has turned by x / radius, whatever the gains say.
TEST(DriveChain, CountsTheAnglesOfItsWheels)
{
    Model model = Lagging(0.1);
    model.base.forward_gain = 0.5;
    Player player(model, 0.02);
    player.Play({1, -0.5, 0, 0.25}, 0.4);
    const double way_m = kFull_mps * (0.4 - 0.1 * (1 - std::exp(-4)));
    const Wheels duty{1, -0.5, 0, 0.25};
    for (size_t k = 0; k < kMaxWheels; ++k)
        EXPECT_NEAR(player.state.wheel_rad[k], duty[k] * way_m / model.robot.wheel_radius_m, 1e-12);
}

TEST(DriveChain, FollowsVelocityCommandsWhateverTheWheels)
{
    for (const WheelKind wheels : {WheelKind::kMecanum, WheelKind::kOmni3, WheelKind::kNone})
    {
        Model model;
        model.base.drive = Drive::kTwist;
        model.base.wheels = wheels;
        Player player(model, 0.02);
        player.Play({0.2, -0.1, 0.5, 0}, 0.02);
        EXPECT_NEAR(player.state.vx_mps, 0.2, 1e-14);
        EXPECT_NEAR(player.state.vy_mps, -0.1, 1e-14);
        EXPECT_NEAR(player.state.omega_radps, 0.5, 1e-13);
    }
}

TEST(DriveChain, ScalesEachDirectionByItsGainAndTheRobotsFactors)
{
    Model model;
    model.base.forward_gain = 0.9;
    model.base.sideways_gain = 0.7;
    model.base.yaw_gain = 1.2;
    model.theta_a1 = 1.1;
    model.theta_a2 = 0.8;
    Player player(model, 0.02);
    player.Play(kForward, 0.02);
    EXPECT_NEAR(player.state.vx_mps, kFull_mps * 0.9 * 1.1, 1e-14);
    player.Play(kStrafeLeft, 0.02);
    EXPECT_NEAR(player.state.vy_mps, kFull_mps * 0.7 * 1.1, 1e-14);
    player.Play(kTurnLeft, 0.02);
    EXPECT_NEAR(player.state.omega_radps, kFull_mps / kLever_m * 1.2 * 0.8, 1e-13);
}

// A wheel that rolls freely has no motor lag, whichever effect stands first: way v^2 / (2 a).
TEST(DriveChain, RollsToAStopWithoutItsLagInEitherOrder)
{
    const double a_mps2 = 1, tau_s = 0.1;
    const Model orders[] = {With("motor_lag", {tau_s}, With("coasting", {a_mps2})),
                            With("coasting", {a_mps2}, With("motor_lag", {tau_s}))};
    for (const Model &model : orders)
    {
        Player player(model, 0.022);
        player.Play(kForward, 30 * 0.3);
        const double start_m = player.state.pose.x_m;
        player.Play(kStop, 30 * 0.3);
        EXPECT_NEAR(player.state.pose.x_m - start_m, kFull_mps * kFull_mps / (2 * a_mps2), 1e-12);
    }
}

// A biased heading turns the marker's lever too if it comes first: the way back is in reverse
// order.
TEST(DriveChain, UndoesWhatIsSeenInReverseOrder)
{
    for (const auto &[first, second] :
         {std::pair{"heading_bias", "marker_offset"}, {"marker_offset", "heading_bias"}})
    {
        Model model;
        model.AddEffect(first);
        model.AddEffect(second);
        model.Set("heading_bias.bias_rad", 0.2);
        model.Set("marker_offset.x_m", 0.3);
        const DriveChain chain(model);
        Pose2 pose{1, 2, 3};
        double t_s = 4;
        chain.Observe(pose, t_s);
        EXPECT_GT(std::abs(pose.x_m - 1), 0.1);
        chain.Invert(pose, t_s);
        EXPECT_NEAR(pose.x_m, 1, 1e-14);
        EXPECT_NEAR(pose.y_m, 2, 1e-14);
        EXPECT_NEAR(pose.theta_rad, 3, 1e-14);
    }
}

// Sideways velocities of a robot that drives straight on with drive noise.
struct NoisyDrive
{
    std::vector<double> vy_mps, y_m, omega_radps;
};

NoisyDrive DriveWithNoise(const Noise &noise, double dt_s, int steps)
{
    Model model;
    model.noise = noise;
    Random random(11, 0, "drive_noise");
    Player player(model, dt_s, {}, &random);
    player.Play(kForward, 20);  // forgets its start at rest
    NoisyDrive drive;
    for (int i = 0; i < steps; ++i)
    {
        player.Play(kForward, dt_s);
        drive.vy_mps.push_back(player.state.vy_mps);
        drive.y_m.push_back(player.state.pose.y_m);
        drive.omega_radps.push_back(player.state.omega_radps);
    }
    return drive;
}

// Mean product of values `lag` apart; the noise has mean zero.
double Covariance(const std::vector<double> &v, size_t lag)
{
    return std::inner_product(v.begin() + static_cast<std::ptrdiff_t>(lag), v.end(), v.begin(),
                              0.0) /
           static_cast<double>(v.size() - lag);
}

// Uhlenbeck and Ornstein 1930: covariance s^2 exp(-lag / tau). Over 4000 s there are 4000 / tau
// independent squares, so the variance is known to sqrt(2 tau / 4000) = 0.9 and 1.6 %: bounds at 4
// of these.
TEST(DriveNoise, HasItsVarianceAndMemory)
{
    Noise noise;
    noise.drive_mps = 0.02;
    noise.drive_s = 0.15;
    noise.drive_radps = 0.3;
    noise.drive_turn_s = 0.5;
    const NoisyDrive drive = DriveWithNoise(noise, 0.01, 400000);
    const double variance = 0.02 * 0.02, turn_variance = 0.3 * 0.3;
    for (const double lag_s : {0.0, 0.05, 0.15, 0.3})
    {
        const auto lag = static_cast<size_t>(std::lround(lag_s / 0.01));
        EXPECT_NEAR(Covariance(drive.vy_mps, lag) / variance, std::exp(-lag_s / 0.15), 0.035);
        EXPECT_NEAR(Covariance(drive.omega_radps, lag) / turn_variance, std::exp(-lag_s / 0.5),
                    0.065);
    }
}

// The integral of that covariance: 2 s^2 tau (h - tau (1 - exp(-h / tau))). 4000 s / h windows give
// it to sqrt(2 h / 4000), 5 % at the longest: bounds at 4 of these. dt^2 / (12 tau^2) = 0.04 % is
// the step's.
TEST(DriveNoise, SpreadsTheRobotAsTheoryHasIt)
{
    Noise noise;
    noise.drive_mps = 0.02;
    noise.drive_s = 0.15;
    const NoisyDrive drive = DriveWithNoise(noise, 0.01, 400000);
    for (const double h_s : {0.1, 0.5, 2.0})
    {
        const auto window = static_cast<size_t>(std::lround(h_s / 0.01));
        double sum_m2 = 0, count = 0;
        for (size_t i = window; i < drive.y_m.size(); i += window, ++count)
            sum_m2 += std::pow(drive.y_m[i] - drive.y_m[i - window], 2);
        const double theory_m2 =
            2 * 0.02 * 0.02 * 0.15 * (h_s - 0.15 * (1 - std::exp(-h_s / 0.15)));
        EXPECT_NEAR(sum_m2 / count / theory_m2, 1, 4 * std::sqrt(2 * h_s / 4000)) << h_s;
    }
}

TEST(DriveNoise, DoesNotMoveARobotThatStands)
{
    Model model = Lagging(0.05);
    model.noise.drive_mps = 0.02;
    model.noise.drive_radps = 0.3;
    Random random(11, 0, "drive_noise");
    Player player(model, 0.02, {}, &random);
    player.Play(kForward, 1);
    player.Play(kStop, 0.4);  // 8 time constants: below 1 mm/s after 6
    const Pose2 before = player.state.pose;
    player.Play(kStop, 5);
    // What is left of the stop: 1 mm/s times the time constant.
    EXPECT_NEAR(player.state.pose.x_m, before.x_m, 1e-3 * 0.05);
    EXPECT_NEAR(player.state.pose.y_m, before.y_m, 1e-3 * 0.05);
    EXPECT_EQ(player.state.pose.theta_rad, before.theta_rad);
}

// A circle driven at constant steering, from the middle between the axles: its radius there is
// hypot(wheelbase / tan(steering), wheelbase / 2).
TEST(DriveChain, DrivesASteeredRobotOnItsCircle)
{
    Model model;
    model.base.wheels = WheelKind::kAckermann;
    model.base.drive = Drive::kSteering;
    model.robot.half_wheelbase_m = 0.15;
    const double steering_rad = 0.3, rear_m = 0.3 / std::tan(steering_rad);
    Player player(model, 0.01);
    player.Play({0.5, steering_rad, 0, 0}, 4);
    // The middle of the rear axle goes 2 m along its own circle.
    const double turned_rad = 2 / rear_m;
    EXPECT_NEAR(player.state.pose.theta_rad, turned_rad, 1e-12);
    const double x_m = rear_m * std::sin(turned_rad) + 0.15 * std::cos(turned_rad);
    const double y_m = rear_m * (1 - std::cos(turned_rad)) + 0.15 * std::sin(turned_rad);
    EXPECT_NEAR(player.state.pose.x_m, x_m - 0.15, 1e-12);
    EXPECT_NEAR(player.state.pose.y_m, y_m, 1e-12);
}

TEST(DriveChain, SteersThroughItsLag)
{
    Model model;
    model.base.wheels = WheelKind::kAckermann;
    model.base.drive = Drive::kSteering;
    model.base.steering_lag_s = 0.2;
    model.robot.max_steering_rad = 0.4;
    Player player(model, 0.02);
    player.Play({0.5, 9, 0, 0}, 0.2);
    EXPECT_NEAR(player.state.steering_rad, 0.4 * (1 - std::exp(-1)), 1e-12);
}

// 4 % more on the third wheel of three: by the forward kinematics of a circle of wheels that is a
// third of its share along its own direction, and a third of it over the lever.
TEST(DriveChain, GivesEachWheelOfThreeItsOwnGain)
{
    Model model;
    model.base.wheels = WheelKind::kOmni3;
    model.base.drive = Drive::kWheelSpeed;
    model.AddEffect("wheel_gain");
    ASSERT_EQ(model.effects[0].parameters.size(), 3u);
    model.Set("wheel_gain.w3", 0.04);
    EXPECT_THROW(model.Set("wheel_gain.fl", 0.04), std::invalid_argument);
    Player player(model, 0.02);
    player.Play({10, 10, 10, 0}, 0.02);
    const double rim_mps = 10 * model.robot.wheel_radius_m, more_mps = 0.04 * rim_mps;
    const double at_rad = 5 * std::acos(-1.0) / 3;
    EXPECT_NEAR(player.state.omega_radps, (rim_mps + more_mps / 3) / model.robot.half_track_m,
                1e-12);
    EXPECT_NEAR(player.state.vx_mps, -std::sin(at_rad) * more_mps * 2 / 3, 1e-12);
    EXPECT_NEAR(player.state.vy_mps, std::cos(at_rad) * more_mps * 2 / 3, 1e-12);
}

}  // namespace
}  // namespace twin::test

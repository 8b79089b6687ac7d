// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

Model Noisy()
{
    Model model;
    model.noise.drive_mps = 0.02;
    model.noise.drive_radps = 0.3;
    return model;
}

// At constant body velocity a robot goes round a circle; in closed form, with phi = omega t:
// x = (vx sin(phi) - vy (1 - cos(phi))) / omega, y = (vx (1 - cos(phi)) + vy sin(phi)) / omega.
TEST(PlanarPlant, FollowsTheExactArcInStepsOfAnyLength)
{
    Model model;
    model.base.drive = Drive::kTwist;
    const double vx = 0.3, vy = -0.1, omega = 1.5, t_s = 2;
    const double s = std::sin(omega * t_s), c = std::cos(omega * t_s);
    for (const double dt_s : {0.001, 0.02, 0.5, 2.0})
    {
        Player player(model, dt_s);
        player.Play({vx, vy, omega, 0}, t_s);
        EXPECT_NEAR(player.state.pose.x_m, (vx * s - vy * (1 - c)) / omega, 1e-12);
        EXPECT_NEAR(player.state.pose.y_m, (vx * (1 - c) + vy * s) / omega, 1e-12);
        EXPECT_NEAR(player.state.pose.theta_rad, omega * t_s, 1e-12);
    }
}

// The same circle, in ten thousand steps: the vector of the heading keeps its length.
TEST(Course, FollowsTheExactArcInStepsOfAnyLength)
{
    const double vx = 0.3, vy = -0.1, omega = 1.5, t_s = 20;
    const double s = std::sin(omega * t_s), c = std::cos(omega * t_s);
    for (const double dt_s : {0.002, 0.02, 0.5, 2.0})
    {
        Course course({});
        for (int i = 0; i < std::lround(t_s / dt_s); ++i)
            course.Follow({vx, vy, omega}, dt_s);
        EXPECT_NEAR(course.pose().x_m, (vx * s - vy * (1 - c)) / omega, 1e-12);
        EXPECT_NEAR(course.pose().y_m, (vx * (1 - c) + vy * s) / omega, 1e-12);
        EXPECT_NEAR(course.pose().theta_rad, omega * t_s, 1e-11);
    }
}

TEST(Direction, IsTheCosineAndTheSineOfItsAngle)
{
    for (const double rad : {-3.0, -0.051, -0.049, 0.0, 0.02, 0.049, 0.051, 1.0, 7.0})
    {
        const Direction ahead = Direction::Of(rad), turned = ahead.Turned(Direction::Of(0.3));
        EXPECT_NEAR(ahead.c, std::cos(rad), 1e-15);
        EXPECT_NEAR(ahead.s, std::sin(rad), 1e-15);
        EXPECT_NEAR(turned.c, std::cos(rad + 0.3), 1e-15);
        EXPECT_NEAR(turned.s, std::sin(rad + 0.3), 1e-15);
    }
}

// Either side of the angle below which the chord is taken for the arc.
TEST(PlanarPlant, HasNoStepBetweenStraightAndCurved)
{
    Model model;
    model.base.drive = Drive::kTwist;
    for (const double omega : {0.0, 1e-9, 1.9e-6, 2.1e-6, 1e-4})
    {
        Player player(model, 1);
        player.Play({1, 0, omega, 0}, 1);
        EXPECT_NEAR(player.state.pose.x_m, 1 - omega * omega / 6, 1e-12);
        EXPECT_NEAR(player.state.pose.y_m, omega / 2, 1e-12);
    }
}

TEST(PlanarPlant, KeepsRobotsApart)
{
    PlanarPlant plant({Model(), Model(), Model()}, {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, 1);
    ASSERT_EQ(plant.Size(), 3);
    plant.SetCommand(1, {kForward, 0});
    plant.SetCommand(2, {kBack, 0});
    for (int i = 0; i < 50; ++i)
        plant.Step(0.02);
    EXPECT_NEAR(plant.TimeS(), 1, 1e-12);
    EXPECT_EQ(plant.State(0).pose.x_m, 0);
    EXPECT_NEAR(plant.State(1).pose.x_m, 1 + kFull_mps, 1e-12);
    EXPECT_NEAR(plant.State(2).pose.x_m, 2 - kFull_mps, 1e-12);
}

TEST(PlanarPlant, MovesARobotElsewhereWithoutStoppingIt)
{
    PlanarPlant plant({Lagging(0.1)}, {{0, 0, 0}}, 1);
    plant.SetCommand(0, {kForward, 0});
    plant.Step(0.1);
    const Wheels before = plant.State(0).rim_mps;
    plant.Move(0, {5, 6, 1});
    EXPECT_EQ(plant.State(0).rim_mps, before);
    EXPECT_EQ(plant.State(0).pose.x_m, 5);
    EXPECT_EQ(plant.State(0).pose.y_m, 6);
    EXPECT_EQ(plant.State(0).pose.theta_rad, 1);
}

std::vector<Pose2> NoisyEnds(size_t robots, uint64_t seed)
{
    PlanarPlant plant(std::vector<Model>(robots, Noisy()), std::vector<Pose2>(robots), seed);
    std::vector<Pose2> ends;
    for (int i = 0; i < plant.Size(); ++i)
        plant.SetCommand(i, {kForward, 0});
    for (int step = 0; step < 50; ++step)
        plant.Step(0.02);
    for (int i = 0; i < plant.Size(); ++i)
        ends.push_back(plant.State(i).pose);
    return ends;
}

TEST(PlanarPlant, SameSeedSameBitsOtherSeedOthers)
{
    EXPECT_EQ(NoisyEnds(1, 5)[0].y_m, NoisyEnds(1, 5)[0].y_m);
    EXPECT_NE(NoisyEnds(1, 5)[0].y_m, NoisyEnds(1, 6)[0].y_m);
}

TEST(PlanarPlant, ARobotsNoiseIsItsOwnHoweverManyThereAre)
{
    const std::vector<Pose2> two = NoisyEnds(2, 5), four = NoisyEnds(4, 5);
    EXPECT_EQ(two[0].y_m, four[0].y_m);
    EXPECT_EQ(two[1].y_m, four[1].y_m);
    EXPECT_NE(two[0].y_m, two[1].y_m);
}

}  // namespace
}  // namespace twin::test

// SPDX-License-Identifier: Apache-2.0
// twin/swarm: starts, robots, species, script, bodies
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <numbers>

#include "paper_swarm.h"
#include "swarm/robots.h"
#include "swarm/species.h"
#include "swarm/starts.h"

namespace twin
{
namespace
{

std::string ErrorOf(const std::function<void()> &action)
{
    try
    {
        action();
    }
    catch (const std::invalid_argument &error)
    {
        return error.what();
    }
    return "";
}

std::string WriteScript(const std::string &text)
{
    const std::string path = ::testing::TempDir() + "script_" + std::to_string(getpid()) + ".csv";
    std::ofstream(path) << text;
    return path;
}

TEST(StartPoses, BodiesDoNotOverlapAndStayInside)
{
    for (uint64_t seed = 0; seed < 20; ++seed)
    {
        const auto poses = StartPoses(StartShape::kSquare, 12, 1.2, 0.1, seed);
        for (size_t i = 0; i < poses.size(); ++i)
        {
            EXPECT_LE(std::max(std::abs(poses[i].x_m), std::abs(poses[i].y_m)), 0.6);
            for (size_t j = 0; j < i; ++j)
                EXPECT_GE(std::hypot(poses[i].x_m - poses[j].x_m, poses[i].y_m - poses[j].y_m),
                          0.2);
        }
    }
}

// The radius of the authors' start for six robots, 0.48 m, is stated with their model.
TEST(StartPoses, FacingOutIsTheAuthorsPackedDisc)
{
    for (uint64_t seed = 0; seed < 50; ++seed)
        for (const Pose2 &pose : StartPoses(StartShape::kFacingOut, 6, 9, 0, seed))
        {
            EXPECT_LE(std::hypot(pose.x_m, pose.y_m), 0.482);
            EXPECT_NEAR(
                std::remainder(pose.theta_rad - std::atan2(pose.y_m, pose.x_m), 6.283185307), 0,
                1e-6);
        }
}

TEST(StartPoses, TooManyBodiesAreRefusedInWords)
{
    const std::string error = ErrorOf([] { StartPoses(StartShape::kSquare, 100, 0.5, 0.1, 1); });
    EXPECT_NE(error.find("100 robots of 0.1 m radius do not fit"), std::string::npos) << error;
}

TEST(DrawRobots, SpreadIsTheModelsAndMeasuredRobotsKeepTheirOwn)
{
    Model model = PaperModel();
    model.idiosyncrasy.theta_a1_std = 0.04;
    model.sensor.range_std_m = 0.1;
    model.robot_overrides[3]["theta_a1"] = 1.5;
    double sum = 0, square = 0;
    constexpr int kSeeds = 2000;
    for (uint64_t seed = 0; seed < kSeeds; ++seed)
    {
        const auto robots = DrawRobots(model, 4, seed);
        EXPECT_EQ(robots[3].theta_a1, 1.5);
        EXPECT_EQ(robots[0].theta_a2, 1);
        EXPECT_NE(robots[0].sensor.range_m, robots[1].sensor.range_m);
        sum += robots[0].theta_a1 - 1;
        square += (robots[0].theta_a1 - 1) * (robots[0].theta_a1 - 1);
    }
    // Standard errors of mean and standard deviation of a normal sample, four times.
    EXPECT_NEAR(sum / kSeeds, 0, 4 * 0.04 / std::sqrt(kSeeds));
    EXPECT_NEAR(std::sqrt(square / kSeeds), 0.04, 4 * 0.04 / std::sqrt(2.0 * kSeeds));
}

TEST(ParseSpecies, CountsMustAddUpAndNamesBeKnown)
{
    const auto robots = ParseSpecies("milling:2,diffusing:1", std::nullopt);
    ASSERT_EQ(robots.size(), 3u);
    EXPECT_STREQ(robots[1]->name, "milling");
    EXPECT_STREQ(robots[2]->name, "diffusing");
    EXPECT_EQ(ParseSpecies("milling", 8).size(), 8u);
    EXPECT_NE(ErrorOf([] { ParseSpecies("milling:2,diffusing:1", 4); }), "");
    EXPECT_NE(ErrorOf([] { ParseSpecies("milling:0", std::nullopt); }), "");
    EXPECT_NE(ErrorOf([] { ParseSpecies("miling", 6); }).find("milling"), std::string::npos);
}

TEST(RingOf, IsOfTheMostFrequentBehaviour)
{
    const auto ring_of = [](const char *text) { return RingOf(ParseSpecies(text, std::nullopt)); };
    EXPECT_EQ(ring_of("milling:1,diffusing:3").order, (std::vector<size_t>{1, 2, 3, 0}));
    EXPECT_EQ(ring_of("milling:1,diffusing:3").size, 3u);
    EXPECT_EQ(ring_of("diffusing:2,milling:2").order, (std::vector<size_t>{0, 1, 2, 3}));
    EXPECT_EQ(ring_of("diffusing:2,milling:2").size, 2u);
    EXPECT_EQ(ring_of("milling:1,diffusing:1,milling:1").order, (std::vector<size_t>{0, 2, 1}));
}

TEST(Script, HoldsEachRowUntilTheNext)
{
    const auto script =
        Script::Load(WriteScript("t_s,speed_input,turn_input\n1,100,-0.5\n2,0,0\n"));
    EXPECT_EQ(script.At(0.99), nullptr);
    EXPECT_EQ(script.At(1)->input.speed_input_pct, 100);
    EXPECT_EQ(script.At(1.99)->input.turn_input_milli, -500);
    EXPECT_EQ(script.At(5)->input.speed_input_pct, 0);
}

TEST(Script, MistakesNameTheLine)
{
    const auto load = [](const std::string &text) {
        return ErrorOf([&] { Script::Load(WriteScript(text)); });
    };
    EXPECT_NE(load("t,v\n").find("line 1"), std::string::npos);
    EXPECT_NE(load("t_s,speed_input,turn_input\n0,101,0\n").find("line 2"), std::string::npos);
    EXPECT_NE(load("t_s,speed_input,turn_input\n0,1,0\n0,1,0\n").find("line 3"), std::string::npos);
    EXPECT_NE(load("t_s,speed_input,turn_input\n0,1\n").find("line 2"), std::string::npos);
    EXPECT_NE(load("t_s,speed_input,turn_input\n0,x,0\n").find("line 2"), std::string::npos);
}

TEST(PushApart, OverlappingBodiesEndTouchingAndTheirMiddleStays)
{
    std::vector<Pose2> poses{{0, 0, 1}, {0.06, 0.08, 2}, {1, 1, 3}};
    PushApart(poses, poses, std::vector<Body>(3, {0.1, 0}));
    EXPECT_NEAR(std::hypot(poses[1].x_m - poses[0].x_m, poses[1].y_m - poses[0].y_m), 0.2, 1e-12);
    EXPECT_NEAR((poses[0].x_m + poses[1].x_m) / 2, 0.03, 1e-12);
    EXPECT_EQ(poses[2].x_m, 1);
}

// Two bodies slide past each other along y, pressed together by 0.02 m along x.
TEST(PushApart, FrictionTakesBackUpToItsShareOfThePush)
{
    for (const auto &[friction, slid_m, left_m] :
         {std::tuple{0.0, 0.01, 0.01}, std::tuple{0.3, 0.01, 0.004}, std::tuple{0.3, -0.01, -0.004},
          std::tuple{2.0, 0.01, 0.0}})
    {
        std::vector<Pose2> poses{{0, 0.1, 0}, {0.18, 0.1, 0}};
        const std::vector<Pose2> then{{0, 0.1 + slid_m / 2, 0}, {0.18, 0.1 - slid_m / 2, 0}};
        PushApart(poses, then, {{0.1, 0}, {0.1, friction}});
        EXPECT_NEAR(poses[1].x_m - poses[0].x_m, 0.2, 1e-12);
        // They slid by `slid_m`; what is not taken back is left.
        EXPECT_NEAR(slid_m - (poses[0].y_m - poses[1].y_m), left_m, 1e-12) << friction;
        EXPECT_NEAR(poses[1].y_m + poses[0].y_m, 0.2, 1e-12);
    }
}

TEST(PlanarBodies, EachRobotHasItsOwnRadius)
{
    Model model = PaperModel();
    model.robot.body_radius_m = 0.1;
    Model wide = model;
    wide.AddEffect("collision");
    wide.Set("collision.radius_m", 0.05);
    PlanarBodies plant({model, wide}, {{0, 0, 0}, {0.2, 0, 0}}, 1);
    plant.Step(0.01);
    EXPECT_NEAR(plant.State(1).pose.x_m - plant.State(0).pose.x_m, 0.25, 1e-12);
}

}  // namespace
}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
// Bodies of the world before the cameras and in the way of robots. Truth: plane geometry.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>

#include "paper_swarm.h"
#include "sensor/cone_sensor.h"
#include "swarm/camera_sensor.h"
#include "swarm/robots.h"
#include "swarm/starts.h"

namespace twin
{
namespace
{

constexpr double kDeg = std::numbers::pi / 180, kHalf_rad = 24.5 * kDeg, kRange_m = 1.1;

DetectionModel Cone()
{
    DetectionModel cone;
    cone.range_m = kRange_m;
    cone.cone_rad = 2 * kHalf_rad;
    return cone;
}

Capsule Disc(double distance_m, double bearing_rad, double radius_m)
{
    const Eigen::Vector2d at_m{distance_m * std::cos(bearing_rad),
                               distance_m * std::sin(bearing_rad)};
    return {at_m, at_m, radius_m};
}

// It subtends asin(r / d) to each side of its centre.
TEST(PartInView, DiscIsSeenUntilItsRimLeavesTheCone)
{
    const double edge_rad = kHalf_rad + std::asin(0.3 / 0.9);
    for (const double side : {-1.0, 1.0})
    {
        EXPECT_TRUE(PartInView({}, Disc(0.9, side * (edge_rad - 1e-6), 0.3), Cone()));
        EXPECT_FALSE(PartInView({}, Disc(0.9, side * (edge_rad + 1e-6), 0.3), Cone()));
    }
}

TEST(PartInView, DiscIsSeenUntilItsRimIsOutOfRange)
{
    EXPECT_TRUE(PartInView({}, Disc(kRange_m + 0.3 - 1e-9, 0.2, 0.3), Cone()));
    EXPECT_FALSE(PartInView({}, Disc(kRange_m + 0.3 + 1e-9, 0.2, 0.3), Cone()));
    EXPECT_FALSE(PartInView({}, Disc(0.5, 180 * kDeg, 0.3), Cone()));
}

// Along the way of a robot at its left: the cone reaches range sin(half) to the side.
TEST(PartInView, WallBesideIsSeenAsFarAsTheConeReaches)
{
    const double reach_m = kRange_m * std::sin(kHalf_rad) + 0.02;
    const auto wall = [](double y_m) { return Capsule{{-40, y_m}, {60, y_m}, 0.02}; };
    EXPECT_TRUE(PartInView({}, wall(reach_m - 1e-6), Cone()));
    EXPECT_FALSE(PartInView({}, wall(reach_m + 1e-6), Cone()));
}

// The bit of a robot at the origin that looks along x for `colour`.
bool Sees(const fw_bit &bit, const std::vector<Pose2> &poses, const std::vector<SeenBody> &bodies)
{
    ConeSensor sensor(Cone(), {&bit, 1}, 0, 1);
    return sensor.Next({poses, 0, {}, bodies}, 0)->bits;
}

TEST(World, WallHidesWhatIsBehindItAndNothingElse)
{
    const fw_bit green = fw_bit_default();
    const SeenBody wall{{{0.5, -1}, {0.5, 1}, 0.02}, 0.2, std::nullopt, true};
    SeenBody low = wall;
    low.is_solid = false;
    EXPECT_FALSE(Sees(green, {{}, {0.8, 0, 0}}, {wall}));
    EXPECT_TRUE(Sees(green, {{}, {0.4, 0, 0}}, {wall}));
    EXPECT_TRUE(Sees(green, {{}, {0.8, 0, 0}}, {low}));
    const SeenBody goal{{{0.8, 0}, {0.8, 0}, 0.1}, 0.2, TargetColour(), false};
    EXPECT_TRUE(Sees(green, {{}}, {goal}));
    EXPECT_FALSE(Sees(green, {{}}, {goal, wall}));
}

TEST(World, BitsSeeTheirColourAlone)
{
    const fw_bit green = fw_bit_default();
    fw_bit red = green;
    ASSERT_TRUE(fw_bit_parse("all,40,235,0,124,165,255", &red));
    SeenBody post{{{0.6, 0}, {0.6, 0}, 0.05}, 0.2, ColourNamed("red"), true};
    EXPECT_TRUE(Sees(red, {{}}, {post}));
    EXPECT_FALSE(Sees(green, {{}}, {post}));
    post.colour = std::nullopt;
    EXPECT_FALSE(Sees(red, {{}}, {post}));
}

// A pinhole of focal length f shows a disc as 2 f tan(asin(r / d)) pixels, if it looks at its
// centre.
TEST(World, DrawnDiscIsAsWideAsItsAngle)
{
    CameraSettings settings;
    const Pose2 eye{-settings.forward_m, 0, 0};  // the lens is at the origin
    const double radius_m = 0.1, distance_m = 0.8;
    const auto boxes = BoxesOf({Disc(distance_m, 0, radius_m), 0.2, TargetColour(), true}, {});
    ASSERT_EQ(boxes.size(), 1u);
    EXPECT_NEAR(std::atan(boxes[0].half_m.y() / distance_m), std::asin(radius_m / distance_m),
                1e-12);
    // In frames the firmware finds it: its bit is set.
    const Model model = PaperModel();
    const CameraWorld world;
    CameraSensor camera(world, 0, CameraDetectionModel(model, world), 1);
    fw_ctx firmware;
    const fw_config config = fw_config_default();
    ASSERT_EQ(fw_init(&firmware, &config), FW_OK);
    const std::vector<Pose2> poses{eye};
    const std::vector<SeenBody> bodies{{Disc(distance_m, 0, radius_m), 0.2, TargetColour(), true}};
    fw_output out{};
    camera.Expose({poses, 0, {}, bodies}, 1'000'000);
    camera.Decide(1'000'000, firmware, out);
    EXPECT_EQ(out.detected_raw, 1);
}

Command Ahead(double speed_mps)
{
    Command command;
    command.value = {speed_mps, 0, 0, 0};
    return command;
}

TEST(World, PlanarRobotStopsAtAWallAndDrivesOverAGoal)
{
    Model model = PaperModel();
    model.robot.body_radius_m = 0.1;
    const WorldBody wall{"", {{1, -1}, {1, 1}, 0.02}, 0.2, ""},
        goal{"", {{0.5, 0}, {0.5, 0}, 0.1}, 0.2, "red", false};
    PlanarBodies plant({model}, {{0, 0, 0}}, 1, kGridPays, {goal, wall});
    plant.SetCommand(0, Ahead(0.25));
    for (int i = 0; i < 500; ++i)
    {
        plant.Step(0.02);
        EXPECT_LE(plant.State(0).pose.x_m, 1 - 0.02 - 0.1 + 1e-9);
    }
    EXPECT_NEAR(plant.State(0).pose.x_m, 0.88, 1e-9);
}

TEST(World, EvaderPushesARobotThatStandsInItsWay)
{
    Model model = PaperModel();
    model.robot.body_radius_m = 0.1;
    const WorldBody evader{"", {{-1, 0}, {-1, 0}, 0.15}, 0.2, "red", true, {{1, 0}}, 0.5};
    PlanarBodies plant({model}, {{0, 0, 0}}, 1, kGridPays, {evader});
    for (int i = 0; i < 200; ++i)
        plant.Step(0.02);  // 2 m
    EXPECT_NEAR(plant.State(0).pose.x_m, 1 + 0.15 + 0.1, 1e-9);
}

TEST(World, NobodyStartsInASolidBody)
{
    const WorldBody post{"", {{0, 0}, {0, 0}, 0.3}, 0.2, ""};
    for (uint64_t seed = 0; seed < 20; ++seed)
        for (const Pose2 &pose :
             StartPoses(StartShape::kSquare, 6, 1.4, 0.1, seed, std::span(&post, 1)))
            EXPECT_GE(std::hypot(pose.x_m, pose.y_m), 0.4);
}

}  // namespace
}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
// Tests twin/sensor/camera. Truth: conic sections, the same scenes by exact intervals
// (analytic_camera.h), the firmware's own limit, MuJoCo's reading of the MJCF file.
#include "sensor/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numbers>

#include "analytic_camera.h"
#include "fw/step.h"
#include "plant_mujoco/mujoco_plant.h"
#include "swarm/camera_sensor.h"

namespace twin
{
namespace
{

CameraSettings Pinhole()
{
    CameraSettings settings;
    settings.lens.fisheye = false;
    return settings;
}

// Pixels of the largest blob that the firmware finds.
int Blob(const std::vector<uint8_t> &yuyv, const CameraSettings &settings)
{
    const fw_config config = fw_config_default();
    fw_ctx firmware{};
    EXPECT_EQ(fw_init(&firmware, &config), FW_OK);
    fw_frame frame{yuyv.data(), settings.width_px, settings.height_px, 2 * settings.width_px, 1,
                   0,           yuyv.size()};
    fw_output out;
    fw_step(&firmware, &frame, 1, &out);
    return out.blob_px;
}

// How far the mask's edge may lie from the true one: half a pixel because rays go through pixels'
// middles, and half because two neighbours share their colour (the mean of 0 and 1).
constexpr double kEdge_px = 1;
constexpr int kScenes = 1000;

// The eye at the origin, three robots 0.25 to 2.5 m off and more or less ahead.
std::vector<Pose2> RandomRobots(Random &random)
{
    std::vector<Pose2> poses{{0, 0, 0}};
    while (poses.size() < 4)
    {
        const double away_m = 0.25 + 2.25 * random.Uniform();
        const double at_rad = 0.8 * (2 * random.Uniform() - 1);
        const Pose2 pose{away_m * std::cos(at_rad), away_m * std::sin(at_rad),
                         2 * std::numbers::pi * random.Uniform()};
        bool free = true;
        for (const Pose2 &other : poses)
            free = free && std::hypot(pose.x_m - other.x_m, pose.y_m - other.y_m) > 0.25;
        if (free)
            poses.push_back(pose);
    }
    return poses;
}

// A post that stands about in the way to one of the others: robots alone seldom hide a ball.
Box RandomPost(const std::vector<Pose2> &poses, const CameraSettings &settings, Random &random)
{
    const Pose2 &behind = poses[1 + static_cast<size_t>(random.Uniform() * 3)];
    const double part = 0.3 + 0.5 * random.Uniform();
    const double half_m = 0.005 + 0.02 * random.Uniform(), height_m = 0.1 + 0.15 * random.Uniform();
    const double aside_m = 0.05 * (2 * random.Uniform() - 1);
    return {{settings.forward_m + part * (behind.x_m - settings.forward_m),
             part * behind.y_m + aside_m, height_m / 2},
            {half_m, half_m, height_m / 2},
            std::numbers::pi * random.Uniform(),
            Colour::FromRgb(0.8, 0.1, 0.1)};
}

TEST(Camera, SeesABallExactlyWhenAlgebraSeesIt)
{
    const CameraSettings settings = Pinhole();
    const int limit_px = fw_bit_default().min_blob_px;
    Random random(1, 0, "scenes"), posts(1, 0, "posts");
    Camera camera(settings, 0, 1);
    int disagree = 0, in_band = 0, otherwise = 0, seen = 0, hidden = 0;
    for (int i = 0; i < kScenes; ++i)
    {
        const std::vector<Pose2> poses = RandomRobots(random);
        Scene scene = RobotsSeenBy(0, poses, Target::kBall);
        scene.boxes.push_back(RandomPost(poses, settings, posts));
        const Sighting sight = SeeGreen(scene, poses[0], settings, kEdge_px);
        const int blob_px = Blob(camera.Draw(scene, poses[0]), settings);
        hidden += sight.area_px < 0.99 * sight.whole_px;
        seen += blob_px > limit_px;
        const bool in_doubt = sight.least_px <= limit_px && sight.most_px > limit_px;
        in_band += in_doubt;
        otherwise += (blob_px > limit_px) != (sight.largest_px > limit_px);
        disagree += !in_doubt && (blob_px > limit_px) != (sight.least_px > limit_px);
        EXPECT_GE(blob_px, std::floor(sight.least_px) - 1) << "scene " << i;
        EXPECT_LE(blob_px, std::ceil(sight.most_px) + 1) << "scene " << i;
    }
    std::printf(
        "%d scenes: balls partly hidden in %d, seen in %d, within %g px of the limit's edge in "
        "%d, of which %d are decided otherwise than by exact edges\n",
        kScenes, hidden, seen, kEdge_px, in_band, otherwise);
    EXPECT_EQ(disagree, 0);
    EXPECT_LT(in_band, kScenes / 10);
    EXPECT_GT(hidden, kScenes / 5);
    EXPECT_GT(seen, kScenes / 5);
    EXPECT_LT(seen, kScenes * 4 / 5);
}

// A ball's outline is a conic: its area is pi f^2 r^2 sqrt(c^2 - r^2) / (x^2 - r^2)^(3/2).
TEST(Camera, AloneABallHasTheAreaOfItsConic)
{
    const CameraSettings settings = Pinhole();
    Camera camera(settings, 0, 1);
    for (const double x_m : {0.3, 0.5, 0.8})
        for (const double y_m : {-0.1, 0.0, 0.06})
        {
            Scene scene;
            const Eigen::Vector3d c(x_m, y_m, 0.05);
            const double r = 0.02, f = settings.lens.focal_px;
            scene.balls.push_back({c + Eigen::Vector3d(settings.forward_m, 0, settings.height_m), r,
                                   Colour::FromRgb(0.1, 0.78, 0.2)});
            const double area_px = std::numbers::pi * f * f * r * r *
                                   std::sqrt(c.squaredNorm() - r * r) /
                                   std::pow(x_m * x_m - r * r, 1.5);
            const double rows = 2 * f * r / x_m;
            EXPECT_NEAR(Blob(camera.Draw(scene, {}), settings), area_px, 2 * kEdge_px * rows);
            EXPECT_NEAR(SeeGreen(scene, {}, settings, 0).area_px, area_px, 0.005 * area_px);
        }
}

TEST(Camera, WhatIsHiddenIsNotSeen)
{
    const CameraSettings settings;
    Camera camera(settings, 0, 1);
    Scene scene = RobotsSeenBy(0, std::vector<Pose2>{{}, {0.6, 0, 0}}, Target::kBall);
    EXPECT_GT(Blob(camera.Draw(scene, {}), settings), 300);
    scene.boxes.push_back({{0.4, 0, 0.2}, {0.01, 0.2, 0.2}, 0, Colour::FromRgb(0.8, 0.1, 0.1)});
    EXPECT_EQ(Blob(camera.Draw(scene, {}), settings), 0);
    EXPECT_EQ(Blob(camera.Draw(scene, {0, 0, std::numbers::pi}), settings), 0);
}

TEST(Camera, OtherColoursAreNoTarget)
{
    const CameraSettings settings;
    Camera camera(settings, 0, 1);
    Scene scene;
    for (uint64_t seed = 0; seed < 20; ++seed)
    {
        scene.balls = Distractors(30, 0.8, seed);
        EXPECT_EQ(Blob(camera.Draw(scene, {}), settings), 0);
    }
}

// 0.5 (1 - 0.02/4 - 0.1708/16 - 0.2568/64 + 0.9651/256), by hand.
TEST(Lens, FollowsItsFormulaAndBack)
{
    const Lens lens;
    EXPECT_NEAR(lens.Radius(0.5), 0.4920412, 1e-7);
    for (double radius = 0; radius < 0.65; radius += 0.01)
        EXPECT_NEAR(lens.Radius(lens.AngleRad(radius)), radius, 1e-12);
}

// A fisheye shows a far ball at the angle at which it stands.
TEST(Camera, PutsABallWhereTheLensSays)
{
    CameraSettings settings;
    settings.luma_std = settings.chroma_std = settings.exposure_std = settings.flicker_std = 0;
    Camera camera(settings, 0, 1);
    for (const double at_rad : {-0.45, -0.2, 0.1, 0.4})
    {
        Scene scene;
        scene.balls.push_back(
            {{settings.forward_m + 2 * std::cos(at_rad), 2 * std::sin(at_rad), settings.height_m},
             0.05,
             {100, 60, 60}});
        const std::vector<uint8_t> &yuyv = camera.Draw(scene, {});
        double columns = 0, rows = 0, count = 0;
        for (int row = 0; row < 480; ++row)
            for (int pair = 0; pair < 320; ++pair)
                if (yuyv[static_cast<size_t>(row * 1280 + 4 * pair + 3)] < 100)
                {
                    columns += 2 * pair + 1;
                    rows += row + 0.5;
                    ++count;
                }
        const double right_px =
            -621 * settings.lens.Radius(std::abs(at_rad)) * (at_rad < 0 ? -1 : 1);
        EXPECT_NEAR(columns / count, 320 + right_px, 1);
        EXPECT_NEAR(rows / count, 240, 1);
    }
}

TEST(Camera, SameSeedSameBytes)
{
    const Scene scene = RobotsSeenBy(0, std::vector<Pose2>{{}, {0.6, 0, 0}}, Target::kCover);
    const auto draw = [&scene](int robot, uint64_t seed) {
        Camera camera({}, robot, seed);
        camera.Draw(scene, {});
        return camera.Draw(scene, {0.01, 0, 0});
    };
    EXPECT_EQ(draw(1, 2), draw(1, 2));
    EXPECT_NE(draw(1, 2), draw(2, 2));
    EXPECT_NE(draw(1, 2), draw(1, 3));
}

// A target straight ahead of a camera that looks left by the pan lands right of the middle.
TEST(CameraSensor, LooksWhereItsPanSays)
{
    DetectionModel sight = CameraDetectionModel({}, {});
    sight.pan_rad = 0.3;
    CameraSensor camera({}, 0, sight, 1);
    const fw_config config = fw_config_default();
    fw_ctx firmware{};
    ASSERT_EQ(fw_init(&firmware, &config), FW_OK);
    fw_output out;
    camera.Expose({std::vector<Pose2>{{}, {0.8, 0, 0}}, 0}, 1);
    camera.Decide(1, firmware, out);
    const Image picture = camera.LastImage();
    double columns = 0, count = 0;
    for (size_t i = 3; i < picture.yuyv.size(); i += 4)
        if (picture.yuyv[i] < 100)
        {
            columns += static_cast<double>(i % 1280) / 2;
            ++count;
        }
    const Lens lens;
    EXPECT_NEAR(columns / count, 320 + lens.focal_px * lens.Radius(0.3), 4);
}

TEST(CameraSensor, AFrameArrivesAfterItsDelay)
{
    const CameraWorld world;
    DetectionModel sight = CameraDetectionModel({}, world);
    sight.delay_s = 0.05;
    CameraSensor camera(world, 0, sight, 1);
    fw_config config = fw_config_default();
    fw_ctx firmware{};
    ASSERT_EQ(fw_init(&firmware, &config), FW_OK);
    fw_output out;
    for (int step = 0; step < 6; ++step)
    {
        const int64_t now_us = 1'000'000 + 20'000 * step;
        camera.Expose({std::vector<Pose2>{{}, {0.6, 0, 0}}, 0}, now_us);
        camera.Decide(now_us, firmware, out);
        EXPECT_EQ(out.frame_utime_us, step < 3 ? 0 : 1'000'000 + 20'000 * (step - 3));
        EXPECT_EQ(out.detected_raw, step >= 3);
    }
}

TEST(Camera, AgreesWithTheMjcfFile)
{
    MujocoPlant plant(FindModelFile("turbopi.xml"), {Model{}}, {Pose2{}}, {.visuals = true});
    const mjModel *m = plant.model();
    const mjData *d = plant.data();
    const int camera = mj_name2id(m, mjOBJ_CAMERA, NameInWorld(0, "cam").c_str());
    const CameraSettings settings;
    EXPECT_NEAR(d->cam_xpos[3 * camera], settings.forward_m, 1e-9);
    EXPECT_NEAR(d->cam_xpos[3 * camera + 2], settings.height_m, 1e-9);
    const double focal_px = 240 / std::tan(m->cam_fovy[camera] * std::numbers::pi / 360);
    EXPECT_NEAR(settings.lens.focal_px, focal_px, 2);
    const int ball = mj_name2id(m, mjOBJ_GEOM, NameInWorld(0, "ball").c_str());
    const Scene scene = RobotsSeenBy(1, std::vector<Pose2>(2), Target::kBall);
    EXPECT_EQ(scene.balls[0].radius_m, m->geom_size[3 * ball]);
    for (int k = 0; k < 3; ++k)
        EXPECT_NEAR(scene.balls[0].centre_m[k], d->geom_xpos[3 * ball + k], 1e-9);
}

}  // namespace
}  // namespace twin

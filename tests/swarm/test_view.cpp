// SPDX-License-Identifier: Apache-2.0
// twin/sensor/view.cpp and the effects of stages view and decide. Truth: geometry and algebra.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "model_file/model.h"
#include "sensor/cone_sensor.h"

namespace twin
{
namespace
{

constexpr double kDeg = std::numbers::pi / 180;

Pose2 At(double distance_m, double bearing_rad)
{
    return {distance_m * std::cos(bearing_rad), distance_m * std::sin(bearing_rad), 0};
}

DetectionModel ModelWith(const std::string &effect, const std::string &parameter, double value)
{
    Model model;
    model.sensor.range_m = 1;
    model.sensor.cone_rad = 50 * kDeg;
    model.AddEffect(effect);
    model.Set(effect + "." + parameter, value);
    return model.MakeDetectionModel();
}

double See(const DetectionModel &detection, const std::vector<Pose2> &poses, const Blur &blur = {})
{
    return ViewProbability(poses, 0, detection, blur);
}

TEST(View, RangeAngleAndPanMoveTheEdges)
{
    const DetectionModel shorter = ModelWith("view_range", "factor", 0.8);
    EXPECT_EQ(See(shorter, {{}, At(0.79, 0)}), 1);
    EXPECT_EQ(See(shorter, {{}, At(0.81, 0)}), 0);
    const DetectionModel wider = ModelWith("view_angle", "factor", 1.2);
    const DetectionModel panned = ModelWith("view_pan", "pan_rad", 10 * kDeg);
    for (const double sign : {-1.0, 1.0})
    {
        EXPECT_EQ(See(wider, {{}, At(0.5, sign * 29 * kDeg)}), 1);
        EXPECT_EQ(See(wider, {{}, At(0.5, sign * 31 * kDeg)}), 0);
        EXPECT_EQ(See(panned, {{}, At(0.5, (10 + sign * 24) * kDeg)}), 1);
        EXPECT_EQ(See(panned, {{}, At(0.5, (10 + sign * 26) * kDeg)}), 0);
    }
    EXPECT_EQ(ModelWith("view_angle", "factor", 8).cone_rad, 2 * std::numbers::pi);
}

TEST(View, ABodyAcrossTheLineHidesTheTarget)
{
    const DetectionModel detection = ModelWith("occlusion", "radius_m", 0.08);
    const Pose2 target = At(0.9, 24 * kDeg);
    // At 0.5 m a body of 0.08 m spans asin(0.16) = 9.2 degrees to either side of its centre.
    for (const auto &[bearing_deg, hidden] : {std::pair{33.0, true}, std::pair{33.5, false}})
    {
        const Pose2 body = At(0.5, bearing_deg * kDeg);  // itself outside the cone
        EXPECT_EQ(See(detection, {{}, target, body}), hidden ? 0 : 1) << bearing_deg;
    }
    EXPECT_EQ(See(detection, {{}, target, At(0.95, 25.5 * kDeg)}), 1)
        << "a body behind hides nothing";
    EXPECT_EQ(See(detection, {{}, target, At(0.5, 24 * kDeg)}), 1)
        << "the hiding robot is seen itself";
}

// The logistic function at the edge and one scale before and behind it.
TEST(View, ASoftEdgeIsLogistic)
{
    Model model;
    model.sensor.range_m = 1;
    model.AddEffect("view_range");
    model.Set("view_range.softness_m", 0.02);
    const DetectionModel detection = model.MakeDetectionModel();
    EXPECT_NEAR(See(detection, {{}, At(1, 0)}), 0.5, 1e-12);
    EXPECT_NEAR(See(detection, {{}, At(0.98, 0)}), 1 / (1 + std::exp(-1)), 1e-12);
    EXPECT_NEAR(See(detection, {{}, At(1.02, 0), At(1, 0.1)}),
                1 - 0.5 * (1 - 1 / (1 + std::exp(1))), 1e-12);

    ConeSensor sensor(detection, std::array{fw_bit_default()}, 0, 5);
    int seen = 0;
    constexpr int kFrames = 20000;
    for (int i = 0; i < kFrames; ++i)
        seen += sensor.Next({std::vector<Pose2>{{}, At(1.02, 0)}, 0}, 1000 * i)->bits;
    const double p = 1 / (1 + std::exp(1));
    EXPECT_NEAR(seen, kFrames * p, 4 * std::sqrt(kFrames * p * (1 - p)));
}

// A Gaussian error of the pose, drawn often, gives the share that the blur foretells; a logistic
// with the variance of a Gaussian is within 0.023 of it.
TEST(View, BlurIsTheShareOverDrawnPoses)
{
    DetectionModel detection;
    detection.range_m = 1;
    detection.cone_rad = 50 * kDeg;
    Random random(3, 0, "poses");
    const Blur blur{0.01, 0.03};
    for (const Pose2 &target :
         {At(0.99, 0), At(1.02, 0.1), At(0.6, 24 * kDeg), At(0.6, -27 * kDeg)})
    {
        constexpr int kDraws = 20000;
        int seen = 0;
        for (int i = 0; i < kDraws; ++i)
        {
            const auto wrong = [&random](double std) { return std * random.Normal(); };
            const Pose2 eye{wrong(0.01), wrong(0.01), wrong(0.03)};
            seen += InView(eye, {target.x_m + wrong(0.01), target.y_m + wrong(0.01), 0}, detection);
        }
        EXPECT_NEAR(See(detection, {{}, target}, blur), static_cast<double>(seen) / kDraws, 0.03);
    }
}

TEST(View, ExactPosesAgreeWithVanishingBlur)
{
    DetectionModel detection;
    detection.range_m = 1;
    detection.cone_rad = 200 * kDeg;
    detection.target_radius_m = 0.1;
    detection.pan_rad = 0.3;
    Random random(4, 0, "poses");
    for (int i = 0; i < 2000; ++i)
    {
        const auto any = [&random] { return 3 * random.Uniform() - 1.5; };
        const std::vector<Pose2> poses{{any(), any(), 4 * any()}, {any(), any(), 0}};
        EXPECT_NEAR(See(detection, poses), See(detection, poses, {1e-9, 1e-9}), 1e-6);
    }
}

TEST(Decide, RatesAddUpAsChancesDo)
{
    Model model;
    model.sensor.false_negative_rate = 0.1;
    model.sensor.false_positive_rate = 0.2;
    model.AddEffect("missed_detection");
    model.AddEffect("false_detection");
    model.Set("missed_detection.rate", 0.5);
    model.Set("false_detection.rate", 0.5);
    EXPECT_NEAR(model.MakeDetectionModel().miss_rate, 1 - 0.9 * 0.5, 1e-15);
    EXPECT_NEAR(model.MakeDetectionModel().false_rate, 1 - 0.8 * 0.5, 1e-15);
    model.Set("missed_detection.rate", -0.25);
    model.Set("false_detection.rate", -1);
    EXPECT_NEAR(model.MakeDetectionModel().miss_rate, 0.1 * 0.75, 1e-15);
    EXPECT_EQ(model.MakeDetectionModel().false_rate, 0);
}

TEST(Decide, VoteIsAWholeNumberOfFramesThatTheFirmwareTakes)
{
    Model model;
    model.sensor.vote_frames = 10;
    model.AddEffect("vote");
    for (const auto &[extra, frames] :
         {std::pair{4.6, 15.0}, std::pair{-63.0, 1.0}, std::pair{60.0, 64.0}})
    {
        model.Set("vote.extra_frames", extra);
        EXPECT_EQ(model.MakeDetectionModel().vote_frames, frames);
    }
}

// Seen in the picture of 20 ms alone. It is stamped at 70 ms, though 50 ms old.
TEST(Decide, ADelayedPictureCarriesALateStamp)
{
    ConeSensor sensor(ModelWith("sensor_delay", "delay_s", 0.05), std::array{fw_bit_default()}, 0,
                      1);
    for (int64_t t_us = 0; t_us <= 100'000; t_us += 10'000)
    {
        const double x_m = t_us == 20'000 ? 0.5 : 5;
        const auto frame = sensor.Next({std::vector<Pose2>{{}, {x_m, 0, 0}}, 0}, t_us);
        ASSERT_EQ(frame.has_value(), t_us >= 50'000);
        if (frame)
        {
            EXPECT_EQ(frame->utime_us, t_us);
            EXPECT_EQ(frame->bits, t_us == 70'000);
        }
    }
}

}  // namespace
}  // namespace twin

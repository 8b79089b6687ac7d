// SPDX-License-Identifier: Apache-2.0
// Tests the effects of view and decide in drawn frames. Truth: the equations of their cards, and of
// the conic that a ball fills in a pinhole's picture.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "swarm/camera_sensor.h"

namespace twin
{
namespace
{

constexpr double kBallAhead_m = -0.035, kCameraAhead_m = 0.073, kBall_m = 0.02, kFocal_px = 621;
constexpr double kLimit_px = 300;
constexpr int64_t kPeriod_us = 20'000;
// Three standard deviations of a share of so many frames are below this.
constexpr int kFrames = 300;
constexpr double kShare = 0.087;

CameraWorld Pinhole()
{
    CameraWorld world;
    world.settings.lens.fisheye = false;
    return world;
}

struct Setting
{
    const char *name;
    double value;
};

// A robot's program that looks at what its camera is given to see.
class Looker
{
public:
    explicit Looker(const std::vector<Setting> &effects, const CameraWorld &world = Pinhole())
        : camera_(world, 0, CameraDetectionModel(ModelWith(effects), world), 1)
    {
        const fw_config config = fw_config_default();
        EXPECT_EQ(fw_init(&firmware_, &config), FW_OK);
    }

    bool Sees(const std::vector<Pose2> &others)
    {
        std::vector<Pose2> poses{{}};
        poses.insert(poses.end(), others.begin(), others.end());
        camera_.Expose({poses, 0}, now_us_ += kPeriod_us);
        camera_.Decide(now_us_, firmware_, out_);
        return out_.detected_raw;
    }

    double Share(const std::vector<Pose2> &others)
    {
        int seen = 0;
        for (int i = 0; i < kFrames; ++i)
            seen += Sees(others);
        return static_cast<double>(seen) / kFrames;
    }

    int64_t NowUs() const { return now_us_; }
    const fw_output &Output() const { return out_; }

private:
    static Model ModelWith(const std::vector<Setting> &effects)
    {
        Model model;
        for (const Setting &setting : effects)
        {
            const std::string name = setting.name, effect = name.substr(0, name.find('.'));
            if (model.effects.empty() || model.effects.back().spec->card.name != effect)
                model.AddEffect(effect);
            model.Set(name, setting.value);
        }
        return model;
    }

    CameraSensor camera_;
    fw_ctx firmware_{};
    fw_output out_;
    int64_t now_us_ = 0;
};

// A robot whose ball is so far from the camera, at that bearing.
Pose2 BallAt(double distance_m, double bearing_rad = 0)
{
    return {kCameraAhead_m - kBallAhead_m + distance_m * std::cos(bearing_rad),
            distance_m * std::sin(bearing_rad), 0};
}

// pi (f r / d)^2 is the limit.
double RangeOfBall()
{
    return kFocal_px * kBall_m * std::sqrt(std::numbers::pi / kLimit_px);
}

TEST(CameraEffects, RangeIsWhereTheBallFillsTheLimitTimesTheFactor)
{
    for (const double factor : {0.3, 1.0, 1.7})
    {
        Looker looker({{"view_range.factor", factor}});
        EXPECT_TRUE(looker.Sees({BallAt(0.94 * factor * RangeOfBall())})) << factor;
        EXPECT_FALSE(looker.Sees({BallAt(1.06 * factor * RangeOfBall())})) << factor;
    }
}

TEST(CameraEffects, SoftEdgeIsTheCardsLogistic)
{
    Looker looker({{"view_range.softness_m", 0.1}});
    EXPECT_NEAR(looker.Share({BallAt(RangeOfBall() - 0.1)}), 1 / (1 + std::exp(-1)), kShare);
    EXPECT_NEAR(looker.Share({BallAt(RangeOfBall() + 0.1)}), 1 / (1 + std::exp(1)), kShare);
    // Two targets have luck of their own.
    const double missed = 1 / (1 + std::exp(-1));
    EXPECT_NEAR(looker.Share({BallAt(RangeOfBall() + 0.1, 0.1), BallAt(RangeOfBall() + 0.1, -0.1)}),
                1 - missed * missed, kShare);
}

TEST(CameraEffects, AngleTurnsTheEdgeOfThePictureAndLeavesTheRange)
{
    const double own_rad = 2 * std::atan(320 / kFocal_px);
    for (const double factor : {0.5, 1.5, 2.0})
    {
        Looker looker({{"view_angle.factor", factor}});
        const double half_rad = factor * own_rad / 2;
        // The ball is as large in the picture as with the camera's own lens.
        const double ball_rad = kBall_m / 0.5 * kFocal_px / (320 / std::tan(half_rad));
        EXPECT_TRUE(looker.Sees({BallAt(0.5, half_rad - ball_rad)})) << factor;
        EXPECT_TRUE(looker.Sees({BallAt(0.5, -half_rad + ball_rad)})) << factor;
        EXPECT_FALSE(looker.Sees({BallAt(0.5, half_rad + 1.2 * ball_rad)})) << factor;
        EXPECT_TRUE(looker.Sees({BallAt(0.94 * RangeOfBall())})) << factor;
        EXPECT_FALSE(looker.Sees({BallAt(1.06 * RangeOfBall())})) << factor;
    }
}

TEST(CameraEffects, MissesAndFalseDetectionsComeAtTheirRates)
{
    const std::vector<Pose2> one{BallAt(0.6)};
    EXPECT_EQ(Looker({}).Share(one), 1);
    EXPECT_EQ(Looker({}).Share({}), 0);
    Looker misses({{"missed_detection.rate", 0.3}});
    EXPECT_NEAR(misses.Share(one), 0.7, kShare);
    EXPECT_EQ(misses.Share({}), 0);
    Looker imagines({{"false_detection.rate", 0.2}});
    EXPECT_EQ(imagines.Share(one), 1);
    EXPECT_NEAR(imagines.Share({}), 0.2, kShare);
    Looker both({{"missed_detection.rate", 0.3}, {"false_detection.rate", 0.2}});
    EXPECT_NEAR(both.Share(one), 0.7, kShare);
    EXPECT_NEAR(both.Share({}), 0.2, kShare);
}

TEST(CameraEffects, FalseDetectionsNeedNoLevelCamera)
{
    CameraWorld world = Pinhole();
    world.settings.tilt_rad = 0.5;
    world.target = Target::kCover;
    Looker imagines({{"false_detection.rate", 1}, {"view_pan.pan_rad", -0.7}}, world);
    EXPECT_EQ(imagines.Share({}), 1);
}

// The nearer robot stands beside the picture; drawn bodies hide no ball on a mast.
TEST(CameraEffects, ABodyBesideThePictureHidesWhatItsRadiusCovers)
{
    const Pose2 aside{0.45 * std::cos(0.8), 0.45 * std::sin(0.8), 0}, target{0.8, 0, 0};
    const double covers_m = 0.45 * std::sin(0.8);
    EXPECT_FALSE(Looker({}).Sees({aside}));
    EXPECT_TRUE(Looker({}).Sees({aside, target}));
    EXPECT_TRUE(Looker({{"occlusion.radius_m", 0.95 * covers_m}}).Sees({aside, target}));
    EXPECT_FALSE(Looker({{"occlusion.radius_m", 1.05 * covers_m}}).Sees({aside, target}));
}

TEST(CameraEffects, ADelayedPictureIsOlderThanItsTimeStamp)
{
    Looker looker({{"sensor_delay.delay_s", 0.1}});
    for (int step = 0; step < 12; ++step)
    {
        // In view during the first three steps alone, seen five steps later.
        const bool seen = looker.Sees({step < 3 ? BallAt(0.6) : BallAt(0.6, 1.5)});
        EXPECT_EQ(seen, step >= 5 && step < 8) << step;
        const int64_t newest_us = step >= 5 ? looker.NowUs() : 0;
        EXPECT_EQ(looker.Output().frame_utime_us, newest_us) << step;
    }
}

std::string Complaint(const std::vector<Setting> &effects)
{
    try
    {
        Looker looker(effects);
    }
    catch (const std::invalid_argument &error)
    {
        return error.what();
    }
    return "";
}

TEST(CameraEffects, WhatNoPictureCanShowIsRefused)
{
    EXPECT_NE(Complaint({{"view_angle.factor", 4}}).find("view_angle.factor"), std::string::npos);
    EXPECT_NE(Complaint({{"missed_detection.rate", 0.7}, {"false_detection.rate", 0.6}})
                  .find("missed_detection.rate"),
              std::string::npos);
    EXPECT_EQ(Complaint({{"missed_detection.rate", 1}}), "");
}

}  // namespace
}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
// twin/sensor/cone_sensor.cpp
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

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

DetectionModel Cone(double range_m, double cone_rad, double target_radius_m = 0)
{
    DetectionModel sensor;
    sensor.range_m = range_m;
    sensor.cone_rad = cone_rad;
    sensor.target_radius_m = target_radius_m;
    return sensor;
}

TEST(InView, PointIsSeenInsideTheConeAndRangeOnly)
{
    const DetectionModel sensor = Cone(1.1, 49 * kDeg);
    for (const double sign : {-1.0, 1.0})
    {
        EXPECT_TRUE(InView({}, At(1.099, sign * 24.4 * kDeg), sensor));
        EXPECT_FALSE(InView({}, At(1.099, sign * 24.6 * kDeg), sensor));
        EXPECT_FALSE(InView({}, At(1.101, sign * 24.4 * kDeg), sensor));
    }
    EXPECT_FALSE(InView({}, At(0.5, 180 * kDeg), sensor));
}

TEST(InView, RangeIsStrict)
{
    EXPECT_FALSE(InView({}, {1, 0, 0}, Cone(1, 1)));
    EXPECT_FALSE(InView({}, {0, 0, 0}, Cone(1, 1)));
}

TEST(InView, ConeWiderThanAHalfTurnSeesBehind)
{
    EXPECT_TRUE(InView({}, At(0.5, 134 * kDeg), Cone(1, 270 * kDeg)));
    EXPECT_FALSE(InView({}, At(0.5, 136 * kDeg), Cone(1, 270 * kDeg)));
}

// A disc at distance d touches the edge of the cone when its centre is asin(r/d) outside it.
TEST(InView, DiscIsSeenUntilItsLastPartLeavesTheCone)
{
    const DetectionModel sensor = Cone(1.1, 49 * kDeg, 0.1);
    const double edge_rad = 24.5 * kDeg + std::asin(0.1 / 0.8);
    EXPECT_TRUE(InView({}, At(0.8, edge_rad - 1e-6), sensor));
    EXPECT_FALSE(InView({}, At(0.8, edge_rad + 1e-6), sensor));
    EXPECT_FALSE(InView({}, At(1.15, 0), sensor));
}

TEST(ConeSensor, ErrorRatesAreThoseOfTheModel)
{
    constexpr int kFrames = 20000;
    DetectionModel sensor = Cone(1, 1);
    sensor.miss_rate = 0.04;
    sensor.false_rate = 0.1;
    const std::vector<Pose2> apart{{0, 0, 0}, {5, 0, 0}}, close{{0, 0, 0}, {0.5, 0, 0}};
    ConeSensor blind(sensor, std::array{fw_bit_default()}, 0, 1),
        seeing(sensor, std::array{fw_bit_default()}, 0, 2);
    int imagined = 0, missed = 0;
    for (int i = 0; i < kFrames; ++i)
    {
        imagined += blind.Next({apart, 0}, i)->bits;
        missed += !seeing.Next({close, 0}, i)->bits;
    }
    // Four standard deviations of a binomial count.
    EXPECT_NEAR(imagined, 0.1 * kFrames, 4 * std::sqrt(0.1 * 0.9 * kFrames));
    EXPECT_NEAR(missed, 0.04 * kFrames, 4 * std::sqrt(0.04 * 0.96 * kFrames));
}

TEST(ConeSensor, DelayHoldsFramesBackAndKeepsTheirTimeStamps)
{
    DetectionModel sensor = Cone(1, 1);
    sensor.delay_s = 0.05;
    ConeSensor delayed(sensor, std::array{fw_bit_default()}, 0, 1);
    const std::vector<Pose2> apart{{0, 0, 0}, {5, 0, 0}}, close{{0, 0, 0}, {0.5, 0, 0}};
    // Seen in the frame at 20 ms alone; 50 ms of delay end at the frame at 80 ms.
    for (int64_t t_us = 0; t_us <= 100'000; t_us += 20'000)
    {
        const auto frame = delayed.Next({t_us == 20'000 ? close : apart, 0}, t_us);
        ASSERT_EQ(frame.has_value(), t_us >= 60'000) << t_us;
        if (frame)
        {
            EXPECT_EQ(frame->utime_us, t_us - 60'000);
            EXPECT_EQ(frame->bits, t_us == 80'000);
        }
    }
}

}  // namespace
}  // namespace twin

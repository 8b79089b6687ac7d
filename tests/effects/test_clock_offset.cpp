// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(ClockOffset, MovesTheTimeStampAlone)
{
    const DriveChain chain(With("clock_offset", {0.125}));
    Pose2 pose{1, 2, 3};
    double t_s = 10;
    chain.Observe(pose, t_s);
    EXPECT_EQ(t_s, 10.125);
    EXPECT_EQ(pose.x_m, 1);
    EXPECT_EQ(pose.y_m, 2);
    EXPECT_EQ(pose.theta_rad, 3);
    chain.Invert(pose, t_s);
    EXPECT_EQ(t_s, 10);
}

TEST(ClockOffset, TwoAddUp)
{
    const DriveChain chain(With("clock_offset", {0.125}, With("clock_offset", {-0.5})));
    Pose2 pose;
    double t_s = 10;
    chain.Observe(pose, t_s);
    EXPECT_EQ(t_s, 9.625);
}

// Together with the model's own clock, offset and rate.
TEST(ClockOffset, IsInvertedTogetherWithTheModelsClock)
{
    Model model = With("clock_offset", {0.5});
    model.clock.offset_s = -0.2;
    model.clock.rate_ppm = 1e4;
    const DriveChain chain(model);
    for (const double before_s : {-3.0, 0.0, 100.0})
    {
        Pose2 pose;
        double t_s = before_s;
        chain.Observe(pose, t_s);
        chain.Invert(pose, t_s);
        EXPECT_NEAR(t_s, before_s, 1e-13);
    }
}

TEST(ClockOffset, TheModelsClockIsOffsetPlusRateTimesTime)
{
    Model model;
    model.clock.offset_s = -0.2;
    model.clock.rate_ppm = 50;
    Pose2 pose;
    double t_s = 1000;
    DriveChain(model).Observe(pose, t_s);
    EXPECT_NEAR(t_s, 1000 - 0.2 + 0.05, 1e-10);
}

}  // namespace
}  // namespace twin::test

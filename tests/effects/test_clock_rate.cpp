// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(ClockRate, StretchesTheTimeStampAlone)
{
    const DriveChain chain(With("clock_rate", {50}));
    Pose2 pose{1, 2, 3};
    double t_s = 1000;
    chain.Observe(pose, t_s);
    EXPECT_NEAR(t_s, 1000.05, 1e-12);
    EXPECT_EQ(pose.x_m, 1);
    EXPECT_EQ(pose.y_m, 2);
    EXPECT_EQ(pose.theta_rad, 3);
    chain.Invert(pose, t_s);
    EXPECT_NEAR(t_s, 1000, 1e-12);
}

// t' = (t + offset)(1 + rate) in the order of the model file.
TEST(ClockRate, ActsInTheModelsOrder)
{
    const DriveChain chain(With("clock_rate", {100}, With("clock_offset", {0.5})));
    Pose2 pose;
    double t_s = 9.5;
    chain.Observe(pose, t_s);
    EXPECT_NEAR(t_s, 10.001, 1e-14);
}

}  // namespace
}  // namespace twin::test

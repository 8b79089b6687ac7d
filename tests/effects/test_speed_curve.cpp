// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

TEST(SpeedCurve, KeepsRestAndFullDuty)
{
    for (const double bend : {-0.9, 0.5, 2.0})
        for (const double skew : {-2.0, 0.1, 2.0})
        {
            EXPECT_EQ(DutyAfter("speed_curve", {bend, skew}, 0), 0);
            EXPECT_EQ(DutyAfter("speed_curve", {bend, skew}, 1), 1);
            EXPECT_EQ(DutyAfter("speed_curve", {bend, skew}, -1), -1);
        }
}

TEST(SpeedCurve, RisesByAQuarterOfItsBendAtHalfDuty)
{
    EXPECT_DOUBLE_EQ(DutyAfter("speed_curve", {0.4, 0}, 0.5), 0.6);
    EXPECT_DOUBLE_EQ(DutyAfter("speed_curve", {0.4, 1.7}, 0.5), 0.6);
    EXPECT_DOUBLE_EQ(DutyAfter("speed_curve", {-0.4, 0}, 0.5), 0.4);
}

TEST(SpeedCurve, IsOddInDuty)
{
    for (double u = 0.1; u < 1; u += 0.2)
        EXPECT_EQ(DutyAfter("speed_curve", {0.7, -0.3}, -u),
                  -DutyAfter("speed_curve", {0.7, -0.3}, u));
}

TEST(SpeedCurve, SkewLiftsLowDutiesAsMuchAsItLowersHighOnes)
{
    for (double u = 0.05; u < 0.5; u += 0.1)
    {
        const double low = DutyAfter("speed_curve", {0, 0.5}, u) - u;
        EXPECT_GT(low, 0);
        EXPECT_NEAR(DutyAfter("speed_curve", {0, 0.5}, 1 - u) - (1 - u), -low, 1e-15);
    }
}

// A cubic has no fourth difference.
TEST(SpeedCurve, IsACubic)
{
    const auto at = [](int i) { return DutyAfter("speed_curve", {0.6, 0.4}, 0.1 + 0.2 * i); };
    EXPECT_NEAR(at(0) - 4 * at(1) + 6 * at(2) - 4 * at(3) + at(4), 0, 1e-14);
    EXPECT_GT(std::abs(-at(0) + 3 * at(1) - 3 * at(2) + at(3)), 1e-3);
}

}  // namespace
}  // namespace twin::test

// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

Signals Seen(double theta_rad)
{
    Signals s;
    s.theta_rad = theta_rad;
    MakeAlone("compass_deviation", {0.2, -0.1}).Step(s, nullptr);
    return s;
}

// Along x the cosine's coefficient alone is seen, along y the sine's; the opposite way they are
// turned round.
TEST(CompassDeviation, ErrsOnceATurn)
{
    const double quarter_rad = std::acos(0.0);
    EXPECT_NEAR(Seen(0).theta_rad, 0.2, 1e-12);
    EXPECT_NEAR(Seen(quarter_rad).theta_rad, quarter_rad - 0.1, 1e-12);
    EXPECT_NEAR(Seen(2 * quarter_rad).theta_rad, 2 * quarter_rad - 0.2, 1e-12);
}

TEST(CompassDeviation, IsInvertedToTheHeadingOfTheRobot)
{
    for (const double theta_rad : {-7.0, -1.3, 0.0, 0.4, 2.9, 11.0})
    {
        Signals s = Seen(theta_rad);
        MakeAlone("compass_deviation", {0.2, -0.1}).Invert(s);
        EXPECT_NEAR(s.theta_rad, theta_rad, 1e-12);
    }
}

}  // namespace
}  // namespace twin::test

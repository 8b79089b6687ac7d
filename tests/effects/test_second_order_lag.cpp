// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "drive.h"

namespace twin::test
{
namespace
{

constexpr double kLag_s = 0.08, kSecond_s = 0.05;

// Franklin et al. 2010, eq. of two real poles: 1 - (a exp(-t/a) - b exp(-t/b)) / (a - b).
TEST(SecondOrderLag, StepsLikeTwoRealPoles)
{
    Player player(With("second_order_lag", {kSecond_s}, Lagging(kLag_s)), 0.002);
    for (int step = 1; step < 200; ++step)
    {
        player.Play(kForward, 0.002);
        const double t_s = 0.002 * step;
        const double part =
            1 - (kLag_s * std::exp(-t_s / kLag_s) - kSecond_s * std::exp(-t_s / kSecond_s)) /
                    (kLag_s - kSecond_s);
        EXPECT_NEAR(player.state.rim_mps[0], kFull_mps * part, 1e-3 * kFull_mps);
    }
}

// A robot that follows with two lags is behind by their sum.
TEST(SecondOrderLag, IsBehindByBothTimeConstants)
{
    for (const double dt_s : {0.002, 0.02})
    {
        Player player(With("second_order_lag", {kSecond_s}, Lagging(kLag_s)), dt_s);
        player.Play(kForward, 2);
        EXPECT_NEAR(player.state.pose.x_m, kFull_mps * (2 - kLag_s - kSecond_s), 1e-3 * kFull_mps);
    }
}

TEST(SecondOrderLag, OfNoSecondTimeChangesNothing)
{
    Player with(With("second_order_lag", {0}, Lagging(kLag_s)), 0.02), plain(Lagging(kLag_s), 0.02);
    for (Player *player : {&with, &plain})
        player->Play(kForward, 0.3);
    EXPECT_EQ(with.state.pose.x_m, plain.state.pose.x_m);
}

}  // namespace
}  // namespace twin::test

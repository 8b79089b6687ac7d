// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "plant/random.h"
#include "plant/split_mix.h"

namespace twin::test
{
namespace
{

constexpr int kDraws = 100000;

// Kolmogorov's distance between a sample and its distribution, times sqrt(n): above 1.95 once in
// 1000 (Stephens 1974); the seeds are fixed.
template <class Draw, class Distribution>
double Kolmogorov(Draw draw, Distribution distribution)
{
    std::vector<double> sample(kDraws);
    std::generate(sample.begin(), sample.end(), draw);
    std::sort(sample.begin(), sample.end());
    double distance = 0;
    for (size_t i = 0; i < sample.size(); ++i)
    {
        const double expected = distribution(sample[i]);
        distance = std::max({distance, expected - static_cast<double>(i) / kDraws,
                             static_cast<double>(i + 1) / kDraws - expected});
    }
    return distance * std::sqrt(kDraws);
}

// The first numbers from 1234567 of Vigna's splitmix64.c (2015), as Rosetta Code lists them.
TEST(Random, BitsAreThoseOfTheReference)
{
    uint64_t state = 1234567;
    for (const uint64_t bits : {6457827717110365317u, 3203168211198807973u, 9817491932198370423u,
                                4593380528125082431u, 16408922859458223821u})
        EXPECT_EQ(SplitMix(state), bits);
}

// Sweeps take seeds 1, 2, 3 and so on.
TEST(Random, FirstNumbersOfSuccessiveSeedsAreUniform)
{
    uint64_t seed = 0;
    EXPECT_LT(
        Kolmogorov([&] { return Random(++seed, 0, "test").Uniform(); }, [](double x) { return x; }),
        1.95);
}

TEST(Random, UniformIsUniform)
{
    Random random(1, 2, "test");
    EXPECT_LT(Kolmogorov([&] { return random.Uniform(); }, [](double x) { return x; }), 1.95);
}

TEST(Random, UniformStaysBelowOne)
{
    Random random(1, 2, "test");
    for (int i = 0; i < kDraws; ++i)
    {
        const double u = random.Uniform();
        ASSERT_TRUE(u >= 0 && u < 1);
    }
}

TEST(Random, NormalIsNormal)
{
    Random random(1, 2, "test");
    EXPECT_LT(Kolmogorov([&] { return random.Normal(); },
                         [](double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }),
              1.95);
}

// Both numbers of a Box-Muller pair come from the same draws, yet neither knows the other: their
// correlation, and that of their squares, is within 4 / sqrt(n).
TEST(Random, SuccessiveNormalsAreIndependent)
{
    Random random(3, 0, "test");
    double product = 0, squares = 0;
    for (int i = 0; i < kDraws; ++i)
    {
        const double a = random.Normal(), b = random.Normal();
        product += a * b;
        squares += (a * a - 1) * (b * b - 1) / 2;
    }
    EXPECT_LT(std::abs(product) / kDraws, 4 / std::sqrt(kDraws));
    EXPECT_LT(std::abs(squares) / kDraws, 4 / std::sqrt(kDraws));
}

TEST(Random, SameTripleSameStream)
{
    Random a(5, 6, "name"), b(5, 6, "name");
    for (int i = 0; i < 100; ++i)
        ASSERT_EQ(a.Normal(), b.Normal());
}

// Streams that differ in one part only are uncorrelated, within 4 / sqrt(n).
TEST(Random, OtherSeedRobotOrNameIsAnotherStream)
{
    const auto streams = [] {
        return std::vector<Random>{Random(5, 6, "name"),  Random(6, 6, "name"),
                                   Random(5, 7, "name"),  Random(5, 6, "mane"),
                                   Random(5, 6, "name2"), Random(5 + (1ull << 40), 6, "name")};
    };
    const size_t count = streams().size();
    for (size_t i = 0; i < count; ++i)
        for (size_t k = i + 1; k < count; ++k)
        {
            Random a = streams()[i], b = streams()[k];
            double product = 0;
            for (int draw = 0; draw < 10000; ++draw)
                product += a.Normal() * b.Normal();
            EXPECT_LT(std::abs(product) / 10000, 4.0 / 100) << i << " and " << k;
        }
}

}  // namespace
}  // namespace twin::test

// SPDX-License-Identifier: Apache-2.0
// Fits follow the slope of predictions along each parameter: it must exist, and be the same from
// both sides.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "drive.h"

namespace twin::test
{
namespace
{

using Seen = std::array<double, 4>;  // x, y, heading and time stamp after a medley of drives

Seen SeenAt(const EffectSpec &spec, const std::vector<double> &values)
{
    Player player(With(spec.card.name, values, Lagging(0.05)), 0.022);
    PlayMedley(player);
    player.Play({0.5, 0.9, 0.5, 0.9}, 0.66, 7.0);  // seen while moving: a delay shows
    Pose2 pose = player.state.pose;
    double t_s = 5;
    player.chain.Observe(pose, t_s);
    return {pose.x_m, pose.y_m, pose.theta_rad, t_s};
}

Seen Slope(const EffectSpec &spec, std::vector<double> values, size_t k, double step)
{
    const Seen here = SeenAt(spec, values);
    values[k] += step;
    Seen slope = SeenAt(spec, values);
    for (size_t i = 0; i < slope.size(); ++i)
        slope[i] = (slope[i] - here[i]) / step;
    return slope;
}

double Largest(const Seen &slope)
{
    double largest = 0;
    for (const double s : slope)
        largest = std::max(largest, std::abs(s));
    return largest;
}

// Two slopes agree to 2 % of their largest component; at the steps taken curvature makes 1 %.
void ExpectSame(const Seen &a, const Seen &b, const std::string &what)
{
    double difference = 0;
    for (size_t i = 0; i < a.size(); ++i)
        difference = std::max(difference, std::abs(a[i] - b[i]));
    EXPECT_LE(difference, 0.02 * std::max(Largest(a), Largest(b))) << what;
}

class Smooth : public testing::TestWithParam<const EffectSpec *>
{
};

// Effects that a drive shows; those of bodies and cameras have no path to follow.
std::vector<const EffectSpec *> OfTheDrive()
{
    std::vector<const EffectSpec *> specs;
    for (const EffectSpec *spec : Catalogue())
        if (std::set<std::string>{"duty", "wheel", "ground", "observe"}.contains(
                StageName(spec->act)))
            specs.push_back(spec);
    return specs;
}

INSTANTIATE_TEST_SUITE_P(Catalogue, Smooth, testing::ValuesIn(OfTheDrive()),
                         [](const auto &spec) { return std::string(spec.param->card.name); });

// The slope along parameter k, checked; 1 is 1 mm, 1 mrad or 1 ms over the parameter's range.
double CheckedSlope(const EffectSpec &spec, const std::vector<double> &values, size_t k)
{
    const Parameter p = ParametersOf(spec)[k];
    // A place may be far away, but what happens there has the size of a robot.
    const double step = 1e-4 * std::min(p.max - p.min, 10.0);
    const std::string what = std::string(p.name) + " = " + std::to_string(values[k]);
    const Seen right = Slope(spec, values, k, step);
    ExpectSame(right, Slope(spec, values, k, step / 10), what);
    if (values[k] - step >= p.min)
        ExpectSame(right, Slope(spec, values, k, -step), what);
    return Largest(right) * (p.max - p.min) / 1e-3;
}

TEST_P(Smooth, SlopeIsTheSameFromBothSidesAndAtTwoSteps)
{
    const EffectSpec &spec = *GetParam();
    std::vector<double> values;
    for (const Parameter &p : ParametersOf(spec))
        values.push_back(p.default_value);
    for (size_t k = 0; k < values.size(); ++k)
        EXPECT_GT(CheckedSlope(spec, values, k), 1)
            << ParametersOf(spec)[k].name << " does nothing";
}

// There the place and size of what has no strength yet have no slope: some parameter must.
TEST_P(Smooth, FromNeutralTheSlopeIsSeenToo)
{
    const EffectSpec &spec = *GetParam();
    // At its neutral deceleration coasting gives way to the lag: a jump. No command reaches a limit
    // that is infinite, none lies below an edge at nothing.
    const std::set<std::string> jumps{"coasting", "speed_limit", "stiction", "wheel_limit"};
    if (jumps.contains(spec.card.name))
        return;
    std::vector<double> values;
    for (const Parameter &p : ParametersOf(spec))
        values.push_back(p.neutral);
    double largest = 0;
    for (size_t k = 0; k < values.size(); ++k)
        largest = std::max(largest, CheckedSlope(spec, values, k));
    EXPECT_GT(largest, 1) << "no slope to start a fit";
}

}  // namespace
}  // namespace twin::test

// SPDX-License-Identifier: Apache-2.0
// twin/swarm/swarm.cpp: what must hold of any swarm.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "paper_swarm.h"
#include "swarm/robots.h"
#include "swarm/starts.h"

namespace twin
{
namespace
{

constexpr int kRobots = 7;
// Rounding differs between a run and its image, and grows slowly: far below a robot's size in 20 s.
constexpr double kRounding_m = 1e-6;

std::vector<Pose2> EndsOf(const std::vector<Model> &models, const std::vector<Pose2> &starts,
                          const std::vector<fw_table> &tables, double duration_s = 20)
{
    Swarm swarm = PlanarSwarm(models, starts, tables);
    while (swarm.TimeS() < duration_s)
        swarm.Step();
    std::vector<Pose2> poses;
    for (int i = 0; i < swarm.Size(); ++i)
        poses.push_back(swarm.State(i).pose);
    return poses;
}

std::vector<Model> Robots(uint64_t seed)
{
    Model model = PaperModel();
    model.idiosyncrasy = {0.04, 0.04};
    return DrawRobots(model, kRobots, seed);
}

void ExpectSame(const Pose2 &a, const Pose2 &b)
{
    EXPECT_NEAR(a.x_m, b.x_m, kRounding_m);
    EXPECT_NEAR(a.y_m, b.y_m, kRounding_m);
    EXPECT_NEAR(std::remainder(a.theta_rad - b.theta_rad, 2 * std::numbers::pi), 0, kRounding_m);
}

class SwarmProperty : public ::testing::TestWithParam<uint64_t>
{
protected:
    std::vector<Model> models_ = Robots(GetParam());
    std::vector<Pose2> starts_ = StartPoses(StartShape::kSquare, kRobots, 1.2, 0, GetParam());
    std::vector<fw_table> tables_ = MillingTables(kRobots);
    std::vector<Pose2> ends_ = EndsOf(models_, starts_, tables_);
};

TEST_P(SwarmProperty, MirrorImageGivesTheMirroredRun)
{
    auto starts = starts_;
    for (Pose2 &pose : starts)
        pose = {pose.x_m, -pose.y_m, -pose.theta_rad};
    auto tables = tables_;
    for (fw_table &table : tables)
    {
        table.rows[1].turn_input_milli *= -1;
        table.rows[0].turn_input_milli *= -1;
    }
    const auto ends = EndsOf(models_, starts, tables);
    for (size_t i = 0; i < kRobots; ++i)
        ExpectSame(ends[i], {ends_[i].x_m, -ends_[i].y_m, -ends_[i].theta_rad});
}

TEST_P(SwarmProperty, TurningAndShiftingTheWorldTurnsAndShiftsTheRun)
{
    const double turn_rad = 1 + static_cast<double>(GetParam());
    const auto moved = [turn_rad](const Pose2 &p) {
        const double c = std::cos(turn_rad), s = std::sin(turn_rad);
        return Pose2{c * p.x_m - s * p.y_m + 5, s * p.x_m + c * p.y_m - 3, p.theta_rad + turn_rad};
    };
    auto starts = starts_;
    std::transform(starts.begin(), starts.end(), starts.begin(), moved);
    const auto ends = EndsOf(models_, starts, tables_);
    for (size_t i = 0; i < kRobots; ++i)
        ExpectSame(ends[i], moved(ends_[i]));
}

TEST_P(SwarmProperty, NamesOfRobotsDoNotMatter)
{
    auto models = models_;
    auto starts = starts_;
    std::rotate(models.begin(), models.begin() + 3, models.end());
    std::rotate(starts.begin(), starts.begin() + 3, starts.end());
    const auto ends = EndsOf(models, starts, tables_);
    for (size_t i = 0; i < kRobots; ++i)
        ExpectSame(ends[i], ends_[(i + 3) % kRobots]);
}

INSTANTIATE_TEST_SUITE_P(Seeds, SwarmProperty, ::testing::Values(1u, 2u, 3u, 4u));

TEST(Swarm, OneRobotCirclesWithRadiusSpeedOverTurnRate)
{
    const double radius_m = 0.25 / (std::numbers::pi / 4);
    Swarm swarm = PlanarSwarm({PaperModel()}, {{1, 2, 0.3}}, MillingTables(1));
    // It sees nobody and turns right: the centre is on its right.
    const double x_m = 1 + radius_m * std::sin(0.3), y_m = 2 - radius_m * std::cos(0.3);
    for (int i = 0; i < 2000; ++i)
    {
        swarm.Step();
        const Pose2 &pose = swarm.State(0).pose;
        ASSERT_NEAR(std::hypot(pose.x_m - x_m, pose.y_m - y_m), radius_m, 1e-9);
    }
}

// speed 100, turn -0.5: trunc(100 + 63) clamped and trunc(100 - 63), the vendor's mixing.
TEST(Swarm, DutiesAreTheFirmwares)
{
    Swarm swarm = PlanarSwarm({Model::Load("turbopi_nominal.toml")}, {{}}, MillingTables(1));
    swarm.Step();
    const fw_output &out = swarm.Output(0);
    EXPECT_EQ(out.mode, FW_MODE_TABLE);
    EXPECT_EQ(out.wheel_duty_pct[FW_FRONT_LEFT], 100);
    EXPECT_EQ(out.wheel_duty_pct[FW_FRONT_RIGHT], 37);
    // 0.36 m/s at full duty: mean of the sides, and their difference over twice 0.126 m.
    EXPECT_NEAR(swarm.State(0).vx_mps, 0.36 * (1 + 0.37) / 2, 1e-9);
    EXPECT_NEAR(swarm.State(0).omega_radps, -0.36 * (1 - 0.37) / (2 * 0.126), 1e-9);
}

TEST(Swarm, RobotsStandUntilTheFirstDelayedFrameArrives)
{
    Model model = PaperModel();
    model.sensor.delay_s = 0.066;
    Swarm swarm = PlanarSwarm({model}, {{}}, MillingTables(1));
    for (int step = 0; step < 5; ++step)
    {
        swarm.Step();
        EXPECT_EQ(swarm.Output(0).mode, step < 3 ? FW_MODE_FAULT : FW_MODE_TABLE) << step;
        EXPECT_EQ(swarm.State(0).vx_mps > 0, step >= 3) << step;
    }
}

TEST(Swarm, DelayBeyondTheFirmwaresTimeOutIsRefused)
{
    Model model = PaperModel();
    model.sensor.delay_s = 0.3;
    EXPECT_THROW(PlanarSwarm({model}, {{}}, MillingTables(1)), std::invalid_argument);
}

// Halving the step may move a path with motor lag by its error alone: second order in 22 ms.
TEST(Swarm, OneStepAPeriodIsFineEnoughForMotorLag)
{
    const auto end = [](double max_step_s) {
        Model model = Model::Load("turbopi.toml");
        model.noise = {};
        model.sensor.false_positive_rate = 0;
        Swarm swarm = PlanarSwarm({model}, {{}}, MillingTables(1), {.max_step_s = max_step_s});
        while (swarm.TimeS() < 10 - 1e-9)
            swarm.Step();
        return swarm.State(0).pose;
    };
    const Pose2 coarse = end(0.025), fine = end(0.0005);
    EXPECT_NEAR(std::hypot(coarse.x_m - fine.x_m, coarse.y_m - fine.y_m), 0, 1e-4);
    EXPECT_NEAR(coarse.theta_rad, fine.theta_rad, 1e-4);
}

}  // namespace
}  // namespace twin

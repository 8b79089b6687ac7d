// SPDX-License-Identifier: Apache-2.0
// The batched kernel against the full path: firmware, cone sensor and planar plant robot by robot.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "fw/behavior.h"
#include "sweep/batch.h"
#include "sweep/worlds.h"

namespace twin
{
namespace
{

Cell PaperCell(int n = 6)
{
    return {Model::Load("paper.toml"),
            std::vector<fw_table>(static_cast<size_t>(n), fw_behavior_find("milling")->table),
            static_cast<size_t>(n)};
}

// A goal, a wall, a post that hides, an evader that crosses all of it, and a robot
// of its team.
void AddWorld(Cell &c)
{
    c.model.robot.body_radius_m = 0.1;
    c.model.sensor.bits = {"all", "left,40,235,0,124,165,255"};
    c.model.sensor.false_negative_rate = 0.04;
    const size_t n = c.tables.size();
    c.tables.assign(n, fw_table{2, {{100, -500}, {100, 300}, {80, -900}, {60, 700}}});
    c.ring_size = n - 1;
    c.colours.assign(n, TargetColour());
    c.colours.back() = ColourNamed("red");
    c.spread_m = 2;
    const auto at = [](double x_m, double y_m) { return Eigen::Vector2d{x_m, y_m}; };
    c.world = {{"goal", {at(0, 0), at(0, 0), 0.5}, 0.2, "red", false},
               {"wall", {at(-2, 1.1), at(2, 1.4), 0.02}, 0.2, "green"},
               {"post", {at(0.7, 0), at(0.7, 0), 0.1}, 0.2, ""},
               {"evader", {at(-2, -1), at(-2, -1), 0.15}, 0.2, "red", true, {at(2, 1)}, 0.3}};
}

struct Variant
{
    const char *name;
    std::function<void(Cell &)> change;
    double duration_s = 20;
};

const Variant kVariants[] = {
    {"paper", [](Cell &) {}},
    {"disc", [](Cell &c) { c.model.sensor.target_radius_m = 0.1; }},
    {"bodies",
     [](Cell &c) {
         c.model.robot.body_radius_m = 0.1;
         c.start = StartShape::kFacingOut;
     }},
    {"errors_and_vote",
     [](Cell &c) {
         c.model.sensor.false_negative_rate = 0.04;
         c.model.sensor.false_positive_rate = 0.1;
         c.model.sensor.vote_frames = 10;
     }},
    {"delay", [](Cell &c) { c.model.sensor.delay_s = 0.1; }},
    // Frames come late by a little more or less than a period: two at once, or none.
    {"ragged_delay",
     [](Cell &c) {
         c.model.base.control_period_s = 0.0133333;
         c.model.sensor.delay_s = 3 * 0.0133333;
         c.model.sensor.vote_frames = 4;
     }},
    {"wide_cone_of_its_own",
     [](Cell &c) {
         c.model.sensor.cone_rad = 3.6;
         c.model.sensor.cone_std_rad = 0.2;
         c.model.sensor.range_std_m = 0.1;
     }},
    {"species",
     [](Cell &c) {
         c.tables.back() = fw_behavior_find("self_centering")->table;
         c.ring_size = 5;
         c.start = StartShape::kDisc;
     }},
    {"three_bits_of_two_colours",
     [](Cell &c) {
         c.model.sensor.bits = {"left", "right", "all,40,235,0,124,165,255"};
         c.model.sensor.target_radius_m = 0.05;
         c.model.sensor.false_negative_rate = 0.04;
         c.model.sensor.false_positive_rate = 0.02;
         c.model.sensor.vote_frames = 3;
         c.tables.assign(6, fw_table{3,
                                     {{100, -500},
                                      {100, 300},
                                      {80, -900},
                                      {60, 0},
                                      {0, 700},
                                      {-50, 200},
                                      {90, -100},
                                      {100, 500}}});
         c.tables.back() = fw_behavior_find("milling")->table;
         c.colours.assign(6, TargetColour());
         c.colours[1] = c.colours[4] = ColourNamed("red");
     }},
    {"duty_drive",
     [](Cell &c) {
         c.model = Model::Load("turbopi_nominal.toml");
         c.model.base.motor_lag_s = 0;
         c.model.noise = {};
         c.model.effects.clear();
     }},
    {"world", AddWorld, 10},
    {"world_seen_late",
     [](Cell &c) {
         AddWorld(c);
         c.model.sensor.delay_s = 0.1;
         c.model.sensor.target_radius_m = 0.1;
     },
     10},
    {"long_period",
     [](Cell &c) {
         c.model.base.control_period_s = 0.06;
         c.model.robot.body_radius_m = 0.1;
     }},
};

void PrintTo(const Variant &variant, std::ostream *out)
{
    *out << variant.name;
}

class BatchKernel : public ::testing::TestWithParam<Variant>
{
};

void ExpectSame(double batched, double full, double tolerance, const char *what)
{
    if (std::isnan(full))
        EXPECT_TRUE(std::isnan(batched)) << what;
    else
        EXPECT_NEAR(batched, full, tolerance * (1 + std::abs(full))) << what;
}

TEST_P(BatchKernel, DoesWhatTheFirmwareAndPlantDo)
{
    Cell cell = PaperCell();
    GetParam().change(cell);
    ASSERT_EQ(WhyNotBatched(cell.model), "");
    std::vector<World> worlds;
    for (uint64_t seed = 1; seed <= 19; ++seed)  // not a multiple of any vector's width
        worlds.push_back({&cell, seed});
    const auto batched = RunWorlds(worlds, GetParam().duration_s, Path::kBest);
    const auto full = RunWorlds(worlds, GetParam().duration_s, Path::kFull);
    for (size_t w = 0; w < worlds.size(); ++w)
    {
        SCOPED_TRACE(worlds[w].seed);
        const Metrics &l = batched[w].mean, &f = full[w].mean;
        ExpectSame(l.circliness, f.circliness, 1e-7, "circliness");
        ExpectSame(l.radius_m, f.radius_m, 1e-7, "radius_m");
        ExpectSame(l.scatter_m2, f.scatter_m2, 1e-7, "scatter_m2");
        ExpectSame(l.rotation, f.rotation, 1e-7, "rotation");
        ExpectSame(l.odd_ratio, f.odd_ratio, 1e-7, "odd_ratio");
        ExpectSame(l.diffusion, f.diffusion, 1e-7, "diffusion");
        ExpectSame(l.groups, f.groups, 0.01, "groups");
        ExpectSame(l.contacts, f.contacts, 0.01, "contacts");
        ExpectSame(batched[w].least_diffusion, full[w].least_diffusion, 1e-7, "least_diffusion");
        const Defence &d = batched[w].defence, &e = full[w].defence;
        ExpectSame(d.caught_s, e.caught_s, 1e-7, "caught_s");
        ExpectSame(d.reached_s, e.reached_s, 1e-7, "reached_s");
        ExpectSame(d.inside, cell.world.empty() ? d.inside : e.inside, 1e-7, "inside");
    }
}

INSTANTIATE_TEST_SUITE_P(Variants, BatchKernel, ::testing::ValuesIn(kVariants),
                         [](const auto &variant) { return std::string(variant.param.name); });

TEST(BatchKernel, GivesTheSameBytesInAnyWidth)
{
    Cell cell = PaperCell(8);
    cell.model.robot.body_radius_m = 0.1;
    cell.model.sensor.target_radius_m = 0.1;
    cell.model.sensor.false_positive_rate = 0.05;
    cell.model.sensor.vote_frames = 3;
    cell.model.sensor.delay_s = 0.05;
    Cell with_bodies = cell;
    AddWorld(with_bodies);
    std::vector<World> worlds;
    for (uint64_t seed = 1; seed <= 16; ++seed)
        worlds.push_back({&cell, seed});
    for (uint64_t seed = 1; seed <= 16; ++seed)
        worlds.push_back({&with_bodies, seed});
    std::vector<std::vector<Outcome>> runs;
    for (const BatchWidth &width : BatchWidths())
    {
        auto &run = runs.emplace_back(worlds.size());
        for (size_t at = 0; at < worlds.size(); at += width.lanes)
            RunBatch(width, std::span(worlds).subspan(at, width.lanes), 30,
                     std::span(run).subspan(at));
        for (size_t w = 0; w < worlds.size(); ++w)
        {
            EXPECT_EQ(run[w].mean.circliness, runs[0][w].mean.circliness) << width.lanes;
            EXPECT_EQ(run[w].mean.diffusion, runs[0][w].mean.diffusion) << width.lanes;
            EXPECT_EQ(run[w].mean.contacts, runs[0][w].mean.contacts) << width.lanes;
            EXPECT_EQ(run[w].defence.inside, runs[0][w].defence.inside) << width.lanes;
        }
    }
}

// Samples end with the run, lie in its last 10 s and fill them, 0.1 s or less apart unless a
// control period is longer.
TEST(CountSteps, MeasuresTheLastTenSeconds)
{
    for (const double period_s : {0.01, 0.0133333, 0.02, 0.022, 0.06, 0.1, 0.25})
    {
        SCOPED_TRACE(period_s);
        const StepCount count = CountSteps(period_s, 120);
        const double end_s = count.steps * period_s, gap_s = std::max(0.1, period_s);
        std::vector<double> times_s;
        for (int step = 0; step < count.steps; ++step)
            if (count.Measures(step))
                times_s.push_back((step + 1) * period_s);
        ASSERT_EQ(times_s.size(), static_cast<size_t>(count.Measured()));
        EXPECT_EQ(times_s.back(), end_s);
        EXPECT_GT(times_s.front(), end_s - 10 - 1e-9);
        EXPECT_LE(times_s.front(), end_s - 10 + gap_s + 1e-9);
        for (size_t i = 1; i < times_s.size(); ++i)
            EXPECT_LE(times_s[i] - times_s[i - 1], gap_s + 1e-9);
    }
    EXPECT_EQ(CountSteps(0.022, 0.01).Measured(), 1);
}

// What single precision cannot tell is left to doubles: near and far from the origin, discs, wide
// cones, and robots that stand in one place.
TEST(BatchKernel, GivesTheSameBytesWithoutItsPrefilter)
{
    const std::function<void(Cell &)> changes[] = {
        [](Cell &) {}, [](Cell &c) { c.model.sensor.target_radius_m = 0.1; },
        [](Cell &c) { c.model.sensor.cone_rad = 3.6; },
        [](Cell &c) { c.model.sensor.range_m = 0.3; },
        [](Cell &c) {
            for (int i = 0; i < 6; ++i)
                c.poses.push_back({4e3 + 0.1 * (i % 5), -1e3, 0.5 * i});
        }};
    for (const auto &change : changes)
    {
        Cell cell = PaperCell();
        change(cell);
        std::vector<World> worlds;
        for (uint64_t seed = 1; seed <= BatchWidths().front().lanes; ++seed)
            worlds.push_back({&cell, seed});
        std::vector<Outcome> with(worlds.size()), without(worlds.size());
        RunBatch(BatchWidths().front(), worlds, 300, with, true);
        RunBatch(BatchWidths().front(), worlds, 300, without, false);
        for (size_t w = 0; w < worlds.size(); ++w)
        {
            EXPECT_EQ(with[w].mean.scatter_m2, without[w].mean.scatter_m2);
            EXPECT_EQ(with[w].mean.rotation, without[w].mean.rotation);
            EXPECT_EQ(with[w].mean.diffusion, without[w].mean.diffusion);
        }
    }
}

}  // namespace
}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
// Predictions over windows against the planar plant, driven window by window.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "drive.h"
#include "predict/predict.h"

namespace twin::test
{
namespace
{

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Half a minute of random commands; poses that a robot could have had, but no robot had.
struct RandomDrive
{
    RandomDrive()
    {
        std::mt19937_64 engine(5);
        std::uniform_real_distribution<double> duty(-1, 1), jitter(0, 0.01);
        for (int i = 0; i < 60; ++i)
        {
            command_t_s.push_back(0.5 * i + jitter(engine));
            for (int k = 0; k < kMaxWheels; ++k)
                command.push_back(duty(engine));
            battery_V.push_back(i % 7 ? 7.2 : kNaN);
        }
        for (int i = 0; i < 1500; ++i)
        {
            pose_t_s.push_back(0.02 * i + 0.003);
            for (int axis = 0; axis < 3; ++axis)
                pose.push_back(std::sin(0.01 * i + axis));
            segment.push_back(i < 700 ? 0 : 1);
        }
        for (int64_t k = 0; k + 60 < 1500; k += 40)
        {
            starts.push_back(k);
            for (const int64_t ahead : {5, 25, 60})
                ends.push_back(segment[static_cast<size_t>(k + ahead)] ==
                                       segment[static_cast<size_t>(k)]
                                   ? k + ahead
                                   : -1);
        }
    }
    Track track() const { return {command_t_s, command, battery_V, pose_t_s, pose, segment}; }

    std::vector<double> command_t_s, command, battery_V, pose_t_s, pose;
    std::vector<int64_t> segment, starts, ends;
};

// Moves in millisecond steps cut at each command.
void Drive(const DriveChain &chain, const RandomDrive &run, double from_s, double to_s,
           RobotState &state)
{
    for (double t_s = from_s; t_s < to_s;)
    {
        Command command;
        double end_s = std::min(to_s, t_s + 1e-3);
        for (size_t i = 0; i < run.command_t_s.size(); ++i)
        {
            if (run.command_t_s[i] > t_s)
            {
                end_s = std::min(end_s, run.command_t_s[i]);
                break;
            }
            std::copy_n(&run.command[kMaxWheels * i], kMaxWheels, command.value.begin());
            command.battery_V = run.battery_V[i];
        }
        PlanarStep(chain, command, t_s, end_s - t_s, state, nullptr);
        t_s = end_s;
    }
}

// Each window by itself: the wheels from the first command on, the body from the measured pose.
std::vector<double> OneByOne(const Model &model, const RandomDrive &run)
{
    const DriveChain chain(model);
    std::vector<double> predicted(3 * run.ends.size(), kNaN);
    for (size_t w = 0; w < run.starts.size(); ++w)
        for (size_t h = 3 * w; h < 3 * w + 3; ++h)
        {
            if (run.ends[h] < 0)
                continue;
            const auto body = [&](int64_t k) {
                const auto at = static_cast<size_t>(k);
                Pose2 pose{run.pose[3 * at], run.pose[3 * at + 1], run.pose[3 * at + 2]};
                double t_s = run.pose_t_s[at];
                chain.Invert(pose, t_s);
                return std::pair{pose, t_s};
            };
            const auto [start, start_s] = body(run.starts[w]);
            RobotState state = chain.Start({});
            Drive(chain, run, run.command_t_s[0], start_s, state);
            state.pose = start;
            Drive(chain, run, std::max(start_s, run.command_t_s[0]), body(run.ends[h]).second,
                  state);
            double t_s = 0;
            chain.Observe(state.pose, t_s);
            predicted[3 * h] = state.pose.x_m;
            predicted[3 * h + 1] = state.pose.y_m;
            predicted[3 * h + 2] = state.pose.theta_rad;
        }
    return predicted;
}

void ExpectNear(std::span<const double> a, std::span<const double> b, double tolerance)
{
    ASSERT_EQ(a.size(), b.size());
    for (size_t i = 0; i < a.size(); ++i)
    {
        ASSERT_EQ(std::isnan(a[i]), std::isnan(b[i])) << i;
        if (std::isnan(a[i]))
            continue;
        ASSERT_NEAR(a[i], b[i], tolerance) << i;
    }
}

Model Base(double motor_lag_s = 0.08)
{
    Model model = Lagging(motor_lag_s);
    model.base.sideways_gain = 0.9;
    model.clock.offset_s = 0.03;
    return With("marker_offset", {0.03, -0.02}, With("wheel_gain", {0.05, 0, -0.04, 0}, model));
}

// Without a lag the speed is constant from command to command, and steps are exact; with one they
// are right to second order in their length.
TEST(Windows, AreWhatThePlantDoesFromEachStart)
{
    const RandomDrive run;
    const Model model = Base(0);
    ASSERT_TRUE(DriveChain(model).IsHomogeneous());
    ExpectNear(PredictWindows(model, run.track(), run.starts, run.ends), OneByOne(model, run),
               1e-9);
    ExpectNear(PredictWindows(Base(), run.track(), run.starts, run.ends), OneByOne(Base(), run),
               1e-4);
}

// Effects of the room are right to second order in the step of 20 ms.
TEST(Windows, AreWhatThePlantDoesWhereTheRoomMatters)
{
    const RandomDrive run;
    const Model model =
        With("floor_patch", {0.3, 0.2, 0.4, 0.3}, With("carpet_grain", {0.1, 0.05}, Base()));
    ASSERT_FALSE(DriveChain(model).IsHomogeneous());
    ExpectNear(PredictWindows(model, run.track(), run.starts, run.ends), OneByOne(model, run),
               1e-3);
}

// A sender that says the same forty times a second moves no robot another way.
TEST(Windows, AreTheSameHoweverOftenACommandIsRepeated)
{
    const RandomDrive run;
    RandomDrive often = run;
    often.command_t_s.clear(), often.command.clear(), often.battery_V.clear();
    for (size_t i = 0; i < run.battery_V.size(); ++i)
        for (int again = 0; again < 18; ++again)
        {
            often.command_t_s.push_back(run.command_t_s[i] + 0.0263 * again);
            for (size_t k = 0; k < kMaxWheels; ++k)
                often.command.push_back(run.command[kMaxWheels * i + k]);
            often.battery_V.push_back(run.battery_V[i]);
        }
    const Model model = With("carpet_grain", {0.1, 0.05}, Base());
    ExpectNear(PredictWindows(model, often.track(), run.starts, run.ends),
               PredictWindows(model, run.track(), run.starts, run.ends), 1e-12);
}

// Of poses that are rarer than the shortest horizon one ends where it begins, and two ends are one.
TEST(Windows, EndWhereverTheyAreTold)
{
    const RandomDrive run;
    const Model model = With("floor_patch", {0.3, 0.2, 0.4, 0.3}, Lagging(0.08));
    const std::vector<int64_t> starts{3, 3, 7}, ends{3, 5, 5, 5, 7, -1};
    const auto seen = PredictWindows(model, run.track(), starts, ends);
    for (size_t axis = 0; axis < 3; ++axis)
    {
        EXPECT_NEAR(seen[axis], run.pose[3 * 3 + axis], 1e-15);
        EXPECT_EQ(seen[3 + axis], seen[6 + axis]);
        EXPECT_EQ(seen[6 + axis], seen[9 + axis]);
        EXPECT_NEAR(seen[12 + axis], run.pose[3 * 7 + axis], 1e-15);
        EXPECT_TRUE(std::isnan(seen[15 + axis]));
    }
}

// What a formula remembers of the ground was there before a window began. Without a lag the speed
// is constant from command to command, and the state is exact.
TEST(Windows, BeginWithWhatTheGroundRemembers)
{
    const RandomDrive run;
    Model model = Base(0);
    model.AddEffect(
        "equation",
        {{"adds_to", "omega_radps"}, {"formula", "p0*s"}, {"state_rate", "(omega - s)/3"}});
    model.effects.back().parameters[0].value = 0.5;
    ASSERT_TRUE(DriveChain(model).RemembersOnGround());
    ExpectNear(PredictWindows(model, run.track(), run.starts, run.ends), OneByOne(model, run),
               1e-4);
    model.AddEffect("equation", {{"adds_to", "vx_mps"},
                                 {"formula", "p0*(s - vx)"},
                                 {"state_rate", "r"},
                                 {"second_rate", "64*(vx - s) - 1.6*r"}});
    model.effects.back().parameters[0].value = 0.5;
    ExpectNear(PredictWindows(model, run.track(), run.starts, run.ends), OneByOne(model, run),
               1e-4);
}

// Parameters of wheels, of the ground, of what is seen and of the clock.
const std::vector<std::string> kNames{"wheel_gain.fr", "base.yaw_gain", "marker_offset.x_m",
                                      "clock.offset_s", "base.motor_lag_s"};

TEST(Windows, AreTheSameInABatchAsAlone)
{
    const RandomDrive run;
    const std::vector<double> rows{0,    1,   0.03, 0.03, 0.08, 0.1, 1,   0.03, 0.03, 0.08,
                                   0,    0.8, 0.03, 0.03, 0.08, 0,   1.1, 0.01, 0.03, 0.08,
                                   -0.1, 1,   0.03, 0.05, 0.08, 0,   1,   0.03, 0.03, 0.2};
    const std::vector<double> batch =
        PredictWindowsBatch(Base(), run.track(), run.starts, run.ends, kNames, rows);
    const size_t size = 3 * run.ends.size();
    ASSERT_EQ(batch.size(), 6 * size);
    for (size_t b = 0; b < 6; ++b)
    {
        Model model = Base();
        for (size_t p = 0; p < kNames.size(); ++p)
            model.Set(kNames[p], rows[b * kNames.size() + p]);
        ExpectNear(std::span(batch).subspan(b * size, size),
                   PredictWindows(model, run.track(), run.starts, run.ends), 0);
    }
}

// Fifteen are under way at once; of a part there is one, and its robot is alone.
TEST(Windows, OfAPartAreThoseOfItsRow)
{
    const RandomDrive run;
    const Model model =
        With("floor_patch", {0.3, 0.2, 0.4, 0.3}, With("carpet_grain", {0.1, 0.05}, Base()));
    std::vector<int64_t> starts, ends, part;
    std::vector<double> strengths;
    for (int64_t k = 0; k < 120; k += 4)
    {
        part.push_back(static_cast<int64_t>(starts.size()));
        strengths.push_back(0.005 * static_cast<double>(k));
        starts.push_back(k);
        ends.insert(ends.end(), {k + 5, k + 60});
    }
    const std::vector<std::string> names{"floor_patch.strength"};
    const auto whole = PredictWindowsBatch(model, run.track(), starts, ends, names, strengths);
    const auto parts =
        PredictWindowsBatch(model, run.track(), starts, ends, names, strengths, part);
    ASSERT_EQ(parts.size(), 3 * ends.size());
    for (size_t w = 0; w < starts.size(); ++w)
        ExpectNear(std::span(parts).subspan(6 * w, 6),
                   std::span(whole).subspan(w * 3 * ends.size() + 6 * w, 6), 0);
}

TEST(Windows, AreTheSameWhateverWasPredictedBefore)
{
    const RandomDrive run;
    Recordings recordings;
    Track track = run.track();
    track.recordings = &recordings;
    const std::vector<int64_t> starts{3, 11}, ends{30, 50};
    for (int again = 0; again < 2; ++again)
    {
        std::vector<Model> models(3, Base());
        models[0].clock.offset_s = 0.03;
        models[1].clock.offset_s = 0.05;
        models[2].base.motor_lag_s *= 2;
        for (const double size : {0.1, 0.2})
            for (const char *effect : {"dead_zone", "transient_loss", "turn_asymmetry"})
                models.push_back(With(effect, {size}, Base()));
        for (const char *formula : {"p0 * u", "p0 * u * abs(u)"})
        {
            models.push_back(Base());
            models.back().AddEffect("equation", {{"adds_to", "duty"}, {"formula", formula}});
            models.back().effects.back().parameters[0].value = 0.2;
        }
        for (const Model &model : models)
            ExpectNear(PredictWindows(model, track, run.starts, run.ends),
                       PredictWindows(model, run.track(), run.starts, run.ends), 0);
        ExpectNear(PredictWindows(Base(), track, starts, ends),
                   PredictWindows(Base(), run.track(), starts, ends), 0);
    }
}

}  // namespace
}  // namespace twin::test

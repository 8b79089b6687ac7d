// SPDX-License-Identifier: Apache-2.0
// How far the two plants end from each other, drive by drive: prints the table of
// twin/models/turbopi/README.md and holds that file to it. Truth of the claims: a wall stops a body
// where it touches, and Coulomb friction limits how fast a robot can start.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "plant/planar_plant.h"
#include "plant_mujoco/mujoco_plant.h"

namespace twin
{
namespace
{

constexpr double kControl_s = 0.02, kHalfLength_m = 0.095;
constexpr double kFriction = 0.8, kGravity_mps2 = 9.81;

struct Leg
{
    Wheels duty;
    double duration_s;
};

struct Trip
{
    const char *name;
    std::vector<Leg> legs;
    std::optional<double> wall_m{};
};

std::vector<Leg> ForwardAndBack(int count, double duration_s)
{
    std::vector<Leg> legs;
    for (int i = 0; i < count; ++i)
    {
        const double duty = i % 2 ? -1 : 1;
        legs.push_back({{duty, duty, duty, duty}, duration_s});
    }
    return legs;
}

const std::vector<Trip> kTrips{
    {"forward, 2 s", {{{1, 1, 1, 1}, 2}}},
    {"sideways, 2 s", {{{-1, 1, 1, -1}, 2}}},
    {"turn, 2 s", {{{-1, 1, -1, 1}, 2}}},
    {"mill (37, 100 %), 4 s", {{{0.37, 1, 0.37, 1}, 4}}},
    {"forward and back, four times 0.5 s", ForwardAndBack(4, 0.5)},
    {"the same, ten times 0.1 s", ForwardAndBack(10, 0.1)},
    {"one wheel of four stopped, 2 s", {{{1, 1, 1, 0}, 2}}},
    {"into a wall 0.5 m off", {{{1, 1, 1, 1}, 2}}, 0.5},
};

struct Outcome
{
    double path_m = 0, turned_rad = 0;  // of the planar plant
    double apart_m = 0, apart_rad = 0;  // MuJoCo's end from it
};

Model WithoutNoise(double motor_lag_s)
{
    Model model = Model::Load("turbopi.toml");
    model.noise = {};
    model.base.motor_lag_s = motor_lag_s;
    return model;
}

Outcome Compare(const Trip &trip, double motor_lag_s)
{
    const Model model = WithoutNoise(motor_lag_s);
    PlanarPlant planar({model}, {Pose2{}}, 0);
    MujocoPlant mujoco(FindModelFile("turbopi.xml"), {model}, {Pose2{}},
                       {.arena_half_width_m = trip.wall_m});
    Outcome outcome;
    for (const Leg &leg : trip.legs)
        for (int i = 0; i < std::lround(leg.duration_s / kControl_s); ++i)
        {
            const Pose2 before = planar.State(0).pose;
            for (Plant *plant : {static_cast<Plant *>(&planar), static_cast<Plant *>(&mujoco)})
            {
                plant->SetCommand(0, {leg.duty, model.robot.battery_nominal_V});
                plant->Step(kControl_s);
            }
            const Pose2 &now = planar.State(0).pose;
            outcome.path_m += std::hypot(now.x_m - before.x_m, now.y_m - before.y_m);
            outcome.turned_rad += now.theta_rad - before.theta_rad;
        }
    const Pose2 &a = planar.State(0).pose, &b = mujoco.State(0).pose;
    outcome.apart_m = std::hypot(a.x_m - b.x_m, a.y_m - b.y_m);
    outcome.apart_rad = std::abs(a.theta_rad - b.theta_rad);
    return outcome;
}

std::string Rounded(double value, const char *unit)
{
    char text[32];
    std::snprintf(text, sizeof text, value < 9.95 ? "%.1f %s" : "%.0f %s", value, unit);
    return text;
}

std::string Degrees(double angle_rad)
{
    return Rounded(std::abs(angle_rad) * 180 / std::numbers::pi, "degrees");
}

// Parts that round to nothing are left out.
std::string Apart(const Outcome &outcome)
{
    std::string text;
    if (outcome.apart_m > 0.05e-3)
        text = Rounded(1000 * outcome.apart_m, "mm");
    if (outcome.apart_rad > 0.05 * std::numbers::pi / 180)
        text += (text.empty() ? "" : ", ") + Degrees(outcome.apart_rad);
    return text;
}

std::string Row(const Trip &trip, const Outcome &lagging, const Outcome &sudden)
{
    char path[32];
    std::snprintf(path, sizeof path, "%.2f m", lagging.path_m);
    return std::string("| ") + trip.name + " | " +
           (lagging.path_m > 0.005 ? path : Degrees(lagging.turned_rad)) + " | " + Apart(lagging) +
           " | " + Apart(sudden) + " |";
}

std::vector<double> Numbers(const std::string &text)
{
    std::vector<double> numbers;
    const char *at = text.c_str();
    while (*at)
    {
        char *end;
        const double number = std::strtod(at, &end);
        if (end != at)
            numbers.push_back(number);
        at = end == at ? at + 1 : end;
    }
    return numbers;
}

std::string LineOfReadme(const char *name)
{
    std::ifstream readme(MODEL_README);
    for (std::string line; std::getline(readme, line);)
        if (line.starts_with(std::string("| ") + name + " |"))
            return line;
    return "";
}

// What another processor may round otherwise, and the last digit shown.
TEST(PlantDifference, IsWhatTheReadmeSays)
{
    for (const Trip &trip : kTrips)
    {
        const std::string row = Row(trip, Compare(trip, 0.06), Compare(trip, 0));
        std::printf("%s\n", row.c_str());
        const auto said = Numbers(LineOfReadme(trip.name)), found = Numbers(row);
        ASSERT_EQ(said.size(), found.size()) << trip.name;
        for (size_t i = 0; i < found.size(); ++i)
            EXPECT_NEAR(said[i], found[i], 0.03 * found[i] + (found[i] < 10 ? 0.1 : 1))
                << trip.name;
    }
}

// A roller at 45 degrees pushes its robot forward with mu N / sqrt(2) at most, so that a change of
// speed by dv takes the way dv^2 / (sqrt(2) mu g) longer than at once.
double StartLoss(double change_mps)
{
    return change_mps * change_mps / (std::numbers::sqrt2 * kFriction * kGravity_mps2);
}

TEST(PlantDifference, WithoutLagIsTheWayThatFrictionNeedsToStart)
{
    const double top_mps = WithoutNoise(0).base.wheel_speed_mps.back();
    EXPECT_NEAR(Compare(kTrips[0], 0).apart_m, StartLoss(top_mps), 0.05 * StartLoss(top_mps));
    // Four legs: one start, and of the three reversals two make up for each other.
    const double reversal_m = StartLoss(2 * top_mps), expected_m = reversal_m - StartLoss(top_mps);
    EXPECT_NEAR(Compare(kTrips[4], 0).apart_m, expected_m, 0.05 * reversal_m);
}

TEST(PlantDifference, AWallHoldsOneOfTheTwo)
{
    const Trip &trip = kTrips.back();
    const Outcome outcome = Compare(trip, 0.06);
    EXPECT_NEAR(outcome.apart_m, outcome.path_m - (*trip.wall_m - kHalfLength_m), 0.005);
}

}  // namespace
}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
// The catalogue as a whole, and what every effect in it must keep.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>
#include <set>
#include <tuple>

#include "drive.h"
#include "first_order.h"

namespace twin::test
{
namespace
{

std::vector<double> Neutral(const EffectSpec &spec)
{
    std::vector<double> values;
    for (const Parameter &p : ParametersOf(spec))
        values.push_back(p.neutral);
    return values;
}

std::vector<double> Defaults(const EffectSpec &spec)
{
    std::vector<double> values;
    for (const Parameter &p : ParametersOf(spec))
        values.push_back(p.default_value);
    return values;
}

Alone NeutralOf(const EffectSpec &spec)
{
    return MakeAlone(spec.card.name, Neutral(spec));
}

Alone DefaultsOf(const EffectSpec &spec)
{
    return MakeAlone(spec.card.name, Defaults(spec));
}

TEST(Catalogue, IsInAlphabeticalOrderWithoutRepeats)
{
    const auto all = Catalogue();
    for (size_t i = 1; i < all.size(); ++i)
        EXPECT_LT(std::string(all[i - 1]->card.name), all[i]->card.name);
}

// A file is in the catalogue because it is there.
TEST(Catalogue, HoldsEveryFileOfItsFolderUnderItsName)
{
    std::set<std::string> files, effects;
    for (const auto &file : std::filesystem::directory_iterator(CATALOGUE_DIR))
        files.insert(file.path().stem());
    for (const EffectSpec *spec : Catalogue())
    {
        effects.insert(spec->card.name);
        EXPECT_EQ(FindEffect(spec->card.name), spec);
    }
    EXPECT_EQ(files, effects);
    EXPECT_EQ(FindEffect("no_such_effect"), nullptr);
    EXPECT_EQ(FindEffect(""), nullptr);
}

class EveryEffect : public testing::TestWithParam<const EffectSpec *>
{
};

INSTANTIATE_TEST_SUITE_P(Catalogue, EveryEffect, testing::ValuesIn(Catalogue()),
                         [](const auto &spec) { return std::string(spec.param->card.name); });

TEST_P(EveryEffect, HasACompleteCard)
{
    const Card &card = GetParam()->card;
    for (const char *text : {card.name, card.summary, card.equation, card.leaves_out, card.measure,
                             card.reference, StageName(GetParam()->act)})
        EXPECT_FALSE(std::string(text).empty());
    EXPECT_EQ(std::string(card.summary).back(), '.');
    EXPECT_NE(card.drives & kAnyDrive, 0u);
    EXPECT_EQ(card.drives & ~kAnyDrive, 0u);
    for (const char *text : {card.phrase, FamilyName(card.family), NeedsName(card.needs)})
        EXPECT_FALSE(std::string(text).empty());
    // The drive of a formula is its own.
    EXPECT_EQ(ManeuverNames(card.identify).empty(), card.family == Family::kFormula);
}

bool IsOfCamera(const Act &act)
{
    return std::holds_alternative<OnView>(act) || std::holds_alternative<OnDecision>(act);
}

// What a camera sees shows in frames alone; what only frames show is of the camera.
TEST_P(EveryEffect, NeedsFramesIfItIsOfTheCamera)
{
    const Card &card = GetParam()->card;
    const bool of_camera = IsOfCamera(GetParam()->act);
    EXPECT_EQ(card.family == Family::kCamera, of_camera);
    EXPECT_EQ(card.needs == Needs::kFrames || card.needs == Needs::kRawFrames, of_camera);
}

// Where only steady speeds are known, an effect on what follows a change must not be looked for.
TEST_P(EveryEffect, NeedsChangesOrClocksIfItIsOnlyLate)
{
    const EffectSpec &spec = *GetParam();
    const auto late = [](const ParameterSpec &p) { return p.role == Role::kLateness; };
    const bool is_late = std::ranges::any_of(spec.parameters, late);
    EXPECT_TRUE(!is_late || spec.card.needs == Needs::kChanges ||
                spec.card.needs == Needs::kClocks);
}

TEST_P(EveryEffect, HasParametersWithinBounds)
{
    std::set<std::string> names;
    for (const Parameter &p : ParametersOf(*GetParam()))
    {
        EXPECT_TRUE(names.insert(p.name).second) << p.name << " twice";
        EXPECT_FALSE(p.unit.empty()) << p.name;
        EXPECT_FALSE(p.doc.empty()) << p.name;
        EXPECT_LT(p.min, p.max) << p.name;
        EXPECT_TRUE(p.min <= p.neutral && p.neutral <= p.max) << p.name;
        EXPECT_TRUE(p.min <= p.default_value && p.default_value <= p.max) << p.name;
        if (p.role != Role::kDuration)  // no fit starts there
        {
            EXPECT_NE(p.default_value, p.neutral) << p.name << ": a fit would start at nothing";
        }
        EXPECT_GT(p.usual_size, 0) << p.name;
        EXPECT_EQ(p.name.find('{'), std::string::npos) << p.name;
        EXPECT_EQ(p.above.empty(), p.below.empty()) << p.name;
    }
    EXPECT_FALSE(names.empty());
}

Signals RandomSignals(std::mt19937_64 &engine, double t_s)
{
    std::uniform_real_distribution<double> wide(-2, 2), positive(0, 2);
    std::bernoulli_distribution off(0.2);
    Signals s;
    s.t_s = t_s;
    s.dt_s = 0.02;
    s.battery_V = off(engine) ? 0 : 6 + positive(engine);
    s.robot.battery_nominal_V = 7.4;
    s.robot.wheel_radius_m = 0.0325;
    for (size_t k = 0; k < kMaxWheels; ++k)
    {
        s.duty[k] = off(engine) ? 0 : wide(engine) / 2;
        s.rim_mps[k] = wide(engine);
        s.mean_mps[k] = wide(engine);
        s.target_mps[k] = off(engine) ? 0 : wide(engine);
        s.tau_s[k] = off(engine) ? 0 : positive(engine);
        s.max_decel_mps2[k] = off(engine) ? positive(engine) : kNoLimit;
        s.wheel_rad[k] = 10 * wide(engine);
        s.radius_ratio[k] = positive(engine);
    }
    s.moves = !off(engine);
    for (double *v : {&s.x_m, &s.y_m, &s.theta_rad, &s.vx_mps, &s.vy_mps, &s.omega_radps})
        *v = wide(engine);
    s.observed_t_s = 1e3 * wide(engine);
    return s;
}

// No NaN occurs and zeros are positive, so that == on doubles means the same bits.
bool Same(const Signals &a, const Signals &b)
{
    const auto all = [](const Signals &s) {
        return std::tie(s.t_s, s.dt_s, s.battery_V, s.duty, s.rim_mps, s.target_mps, s.tau_s,
                        s.max_decel_mps2, s.mean_mps, s.wheel_rad, s.radius_ratio, s.moves, s.x_m,
                        s.y_m, s.theta_rad, s.vx_mps, s.vy_mps, s.omega_radps, s.observed_t_s);
    };
    return all(a) == all(b);
}

DetectionModel RandomDetectionModel(std::mt19937_64 &engine)
{
    std::uniform_real_distribution<double> one(0, 1);
    DetectionModel s;
    for (double *v : {&s.range_m, &s.softness_m, &s.cone_rad, &s.pan_rad, &s.target_radius_m,
                      &s.hide_radius_m, &s.miss_rate, &s.false_rate, &s.age_s, &s.delay_s})
        *v = one(engine);
    s.vote_frames = std::floor(1 + 63 * one(engine));
    return s;
}

bool Same(const DetectionModel &a, const DetectionModel &b)
{
    const auto all = [](const DetectionModel &s) {
        return std::tie(s.range_m, s.softness_m, s.cone_rad, s.pan_rad, s.target_radius_m,
                        s.hide_radius_m, s.miss_rate, s.false_rate, s.age_s, s.delay_s,
                        s.vote_frames);
    };
    return all(a) == all(b);
}

bool Same(const Body &a, const Body &b)
{
    return std::tie(a.radius_m, a.friction) == std::tie(b.radius_m, b.friction);
}

TEST_P(EveryEffect, AtNeutralLeavesCameraAndBodyAlone)
{
    const auto effect = NeutralOf(*GetParam());
    std::mt19937_64 engine(7);
    for (int i = 0; i < 1000; ++i)
    {
        const DetectionModel detection = RandomDetectionModel(engine);
        const Body body{detection.range_m, detection.miss_rate};
        DetectionModel detection_after = detection;
        Body body_after = body;
        effect.Set(detection_after);
        effect.Set(body_after);
        ASSERT_TRUE(Same(detection, detection_after));
        ASSERT_TRUE(Same(body, body_after));
    }
}

TEST_P(EveryEffect, ByDefaultChangesCameraAndBodyOnlyAtItsStage)
{
    const auto effect = DefaultsOf(*GetParam());
    const Act &act = GetParam()->act;
    std::mt19937_64 engine(7);
    int cameras_changed = 0, bodies = 0;
    for (int i = 0; i < 100; ++i)
    {
        const DetectionModel detection = RandomDetectionModel(engine);
        const Body body{detection.range_m, detection.miss_rate};
        DetectionModel detection_after = detection;
        Body body_after = body;
        effect.Set(detection_after);
        effect.Set(body_after);
        cameras_changed += !Same(detection, detection_after);
        bodies += !Same(body, body_after);
    }
    EXPECT_EQ(cameras_changed > 50, IsOfCamera(act));
    EXPECT_EQ(cameras_changed > 0, IsOfCamera(act));
    EXPECT_EQ(bodies > 50, std::holds_alternative<OnBody>(act));
    EXPECT_EQ(bodies > 0, std::holds_alternative<OnBody>(act));
}

TEST_P(EveryEffect, AtNeutralLeavesTheSignalsAlone)
{
    const auto effect = NeutralOf(*GetParam());
    std::vector<double> state(static_cast<size_t>(effect.StateSize()), 0.0);
    std::mt19937_64 engine(7);
    for (int step = 0; step < 1000; ++step)
    {
        const Signals before = RandomSignals(engine, 0.02 * step);
        Signals after = before;
        effect.Step(after, state.data());
        ASSERT_TRUE(Same(after, before)) << "step " << step;
        effect.Invert(after);
        ASSERT_TRUE(Same(after, before)) << "inverse of step " << step;
    }
}

TEST_P(EveryEffect, ByDefaultChangesSomeSignalIfItActsOnThem)
{
    const auto effect = DefaultsOf(*GetParam());
    std::vector<double> state(static_cast<size_t>(effect.StateSize()), 0.0);
    std::mt19937_64 engine(7);
    int changed = 0;
    for (int step = 0; step < 100; ++step)
    {
        const Signals before = RandomSignals(engine, 0.02 * step);
        Signals after = before;
        effect.Step(after, state.data());
        changed += !Same(before, after);
    }
    const Act &act = GetParam()->act;
    if (IsOfCamera(act) || std::holds_alternative<OnBody>(act))
        EXPECT_EQ(changed, 0);
    else
        EXPECT_GT(changed, 10);
}

// Short predictions share their way over the floor where nothing on it depends on the place; what
// remembers does so for each of them.
TEST_P(EveryEffect, DependsOnPlaceAndHeadingOnlyIfItNeedsTheRoom)
{
    const Card &card = GetParam()->card;
    if (card.needs == Needs::kRoom || card.family == Family::kFormula ||
        !std::holds_alternative<OnGround>(GetParam()->act))
        return;
    const auto effect = DefaultsOf(*GetParam());
    std::vector<double> here_state(static_cast<size_t>(effect.StateSize()));
    std::vector<double> there_state = here_state;
    std::mt19937_64 engine(9);
    for (int step = 0; step < 100; ++step)
    {
        Signals here = RandomSignals(engine, 0), there = here;
        there.x_m += 3;
        there.y_m -= 2;
        there.theta_rad += 1;
        effect.Step(here, here_state.data());
        effect.Step(there, there_state.data());
        EXPECT_EQ(here.vx_mps, there.vx_mps);
        EXPECT_EQ(here.vy_mps, there.vy_mps);
        EXPECT_EQ(here.omega_radps, there.omega_radps);
    }
}

// Windows that are under way at once are passed together.
TEST_P(EveryEffect, TakesSeveralRobotsAsEachAlone)
{
    const auto *on = std::get_if<OnGround>(&GetParam()->act);
    if (!on || !on->steps)
        return;
    const auto effect = DefaultsOf(*GetParam());
    EXPECT_EQ(effect.StateSize(), 0);
    const std::vector<double> values = Defaults(*GetParam());
    std::mt19937_64 engine(10);
    std::vector<Signals> alone;
    EachPose pose;
    Each vx_mps{}, vy_mps{}, omega_radps{};
    for (size_t i = 0; i < kTogether; ++i)
    {
        Signals s = RandomSignals(engine, 0);
        s.moves = true;
        const GroundSignals ground = GroundOf(alone.emplace_back(s));
        pose.x_m[i] = ground.x_m;
        pose.y_m[i] = ground.y_m;
        pose.theta_rad[i] = ground.theta_rad;
        pose.c[i] = ground.ahead.c;
        pose.s[i] = ground.ahead.s;
        vx_mps[i] = ground.vx_mps;
        vy_mps[i] = ground.vy_mps;
        omega_radps[i] = ground.omega_radps;
    }
    const Signals &any = alone.front();
    for (const size_t count : {size_t{1}, size_t{5}, kTogether})
    {
        EachGround together{any.robot, any.t_s, any.dt_s, any.moves,  pose,
                            count,     vx_mps,  vy_mps,   omega_radps};
        on->steps(together, {values});
        for (size_t i = 0; i < kTogether; ++i)
        {
            Signals own = alone[i];
            if (i < count)
                effect.Step(own, nullptr);
            EXPECT_EQ(together.vx_mps[i], own.vx_mps);
            EXPECT_EQ(together.vy_mps[i], own.vy_mps);
            EXPECT_EQ(together.omega_radps[i], own.omega_radps);
        }
    }
}

TEST_P(EveryEffect, InvertsWhatItDoesToThePoseSeenAndNothingElse)
{
    const bool observes = std::holds_alternative<OnObservation>(GetParam()->act);
    const auto effect = DefaultsOf(*GetParam());
    std::mt19937_64 engine(8);
    for (int step = 0; step < 100; ++step)
    {
        const Signals before = RandomSignals(engine, 0);
        Signals after = before;
        if (observes)
            effect.Step(after, nullptr);
        effect.Invert(after);
        EXPECT_NEAR(after.x_m, before.x_m, 1e-15);  // two roundings of numbers up to 2
        EXPECT_NEAR(after.y_m, before.y_m, 1e-15);
        EXPECT_NEAR(after.theta_rad, before.theta_rad, 1e-15);
        EXPECT_NEAR(after.observed_t_s, before.observed_t_s, 1e-12);  // up to 2000
    }
}

void ExpectSame(const RobotState &a, const RobotState &b)
{
    EXPECT_EQ(a.pose.x_m, b.pose.x_m);
    EXPECT_EQ(a.pose.y_m, b.pose.y_m);
    EXPECT_EQ(a.pose.theta_rad, b.pose.theta_rad);
    EXPECT_EQ(a.vx_mps, b.vx_mps);
    EXPECT_EQ(a.vy_mps, b.vy_mps);
    EXPECT_EQ(a.omega_radps, b.omega_radps);
    EXPECT_EQ(a.rim_mps, b.rim_mps);
    EXPECT_EQ(a.wheel_rad, b.wheel_rad);
    EXPECT_EQ(a.drive_noise, b.drive_noise);
    EXPECT_EQ(a.effect_state, b.effect_state);
}

Model Noisy()
{
    Model model = Lagging(0.05);
    model.noise.drive_mps = 0.01;
    model.noise.drive_radps = 0.1;
    return model;
}

TEST_P(EveryEffect, AtNeutralLeavesAWholeDriveAlone)
{
    Random random_a(1, 0, "drive_noise"), random_b(1, 0, "drive_noise");
    const Model with_it = With(GetParam()->card.name, Neutral(*GetParam()), Noisy());
    Model without = with_it;
    without.RemoveEffect(0);
    Player plain(without, 0.022, {}, &random_a);
    Player neutral(with_it, 0.022, {}, &random_b);
    PlayMedley(plain);
    PlayMedley(neutral);
    ExpectSame(plain.state, neutral.state);
    EXPECT_EQ(plain.Seen().x_m, neutral.Seen().x_m);
    EXPECT_EQ(plain.Seen().y_m, neutral.Seen().y_m);
}

TEST_P(EveryEffect, SameSeedSameBits)
{
    const Model model = With(GetParam()->card.name, Defaults(*GetParam()), Noisy());
    Random random_a(1, 0, "drive_noise"), random_b(1, 0, "drive_noise");
    Player a(model, 0.022, {}, &random_a), b(model, 0.022, {}, &random_b);
    PlayMedley(a);
    PlayMedley(b);
    ExpectSame(a.state, b.state);
}

// Copies the state at every step in between, to a chain built anew.
TEST_P(EveryEffect, RestartsFromACopyOfItsState)
{
    const Model model = With(GetParam()->card.name, Defaults(*GetParam()), Lagging(0.05));
    const DriveChain chain(model);
    constexpr int kSteps = 60, kSwitch = 20;
    const auto step = [](const DriveChain &with, RobotState &state, int i) {
        PlanarStep(with, {i < kSwitch ? Wheels{0.4, 0.9, 0.3, 0.8} : kStop, 7.0}, 0.02 * i, 0.02,
                   state, nullptr);
    };
    std::vector<RobotState> path{chain.Start({})};
    for (int i = 0; i < kSteps; ++i)
    {
        path.push_back(path.back());
        step(chain, path.back(), i);
    }
    const DriveChain other(model);
    for (int from = 0; from < kSteps; from += 7)
    {
        RobotState state = path[static_cast<size_t>(from)];
        for (int i = from; i < kSteps; ++i)
            step(other, state, i);
        ExpectSame(state, path.back());
    }
}

// Of effects that change within a step: some micrometres of those that are right to second order,
// some millimetres of formulas, which the plant evaluates at the beginning of a step.
double Tolerance(const std::string &effect)
{
    if (FirstOrder().contains(effect))
        return 5e-3;
    for (const char *second_order : {"abrupt_loss", "transient_loss", "coasting", "floor_patch",
                                     "wheel_eccentricity", "second_order_lag", "yaw_lag"})
        if (effect == second_order)
            return 1e-5;
    return 1e-12;
}

// On straight drives the discretisation is exact: half the step, same answer but for rounding.
TEST_P(EveryEffect, HalfTheStepGivesTheSameAnswerOnStraightDrives)
{
    const Model model = With(GetParam()->card.name, Defaults(*GetParam()));
    const double tolerance = Tolerance(GetParam()->card.name);
    Player coarse(model, 0.02), fine(model, 0.01);
    for (Player *player : {&coarse, &fine})
        for (Wheels leg : {kForward, kStop, Scaled(kBack, 0.5), kStop, kStrafeLeft})
        {
            if (model.base.drive == Drive::kTwist)
                leg[2] = 0;  // the turn rate
            player->Play(leg, 0.8, 7.0);
        }
    EXPECT_NEAR(coarse.state.pose.x_m, fine.state.pose.x_m, tolerance);
    EXPECT_NEAR(coarse.state.pose.y_m, fine.state.pose.y_m, tolerance);
    EXPECT_NEAR(coarse.state.pose.theta_rad, fine.state.pose.theta_rad, tolerance);
    EXPECT_NEAR(coarse.Seen().x_m, fine.Seen().x_m, tolerance);
}

// The plant asks those that show in steady speeds, on duties and on wheels, once per command.
TEST_P(EveryEffect, OfSteadySpeedsAsksTheSameOfWheelsWheneverAndHoweverTheyTurn)
{
    const EffectSpec &spec = *GetParam();
    if (spec.card.needs != Needs::kSteadySpeed || spec.card.family == Family::kFormula)
        return;
    const BoundEffect effect(spec, Defaults(spec));
    const RobotFacts robot{.wheel_radius_m = 0.03, .battery_nominal_V = 7.4};
    const Wheels told{0.4, -0.1, 0.7, 0}, rest{}, turning{0.2, -0.3, 0.1, 0.5};
    ASSERT_EQ(effect.StateSize(), 0);
    if (const auto *on = std::get_if<OnDuty>(&effect.act()))
    {
        DutySignals early{robot, 0, 7.4, 0, told}, late{robot, 60, 6, 0.05, told};
        on->step(early, effect.numbers(), nullptr);
        on->step(late, effect.numbers(), nullptr);
        EXPECT_EQ(early.duty, late.duty);
        EXPECT_EQ(late.dt_s, 0.05);
    }
    if (const auto *on = std::get_if<OnWheels>(&effect.act()))
    {
        WheelSignals early{robot, 0, 0, 7.4, told, rest, rest, told};
        WheelSignals late{robot, 60, 0.05, 6, told, turning, turning, told};
        early.tau_s.fill(0.06);
        late.tau_s.fill(0.06);
        const Wheels tau_s = early.tau_s, max_decel_mps2 = early.max_decel_mps2;
        on->step(early, effect.numbers(), nullptr);
        on->step(late, effect.numbers(), nullptr);
        EXPECT_EQ(early.target_mps, late.target_mps);
        for (const WheelSignals &s : {early, late})
        {
            EXPECT_EQ(s.tau_s, tau_s);
            EXPECT_EQ(s.max_decel_mps2, max_decel_mps2);
        }
    }
}

}  // namespace
}  // namespace twin::test

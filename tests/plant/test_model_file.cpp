// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>

#include "model_file/model.h"

namespace twin::test
{
namespace
{

Model Parse(const std::string &text)
{
    return Model::FromToml(text, "m.toml");
}

// What is wrong with the text, in the words of the error.
std::string Complaint(const std::string &text)
{
    try
    {
        Parse(text);
    }
    catch (const std::invalid_argument &error)
    {
        return error.what();
    }
    return "accepted";
}

struct Bad
{
    const char *name, *text;
    std::vector<std::string> says;
};

class BadModel : public testing::TestWithParam<Bad>
{
};

TEST_P(BadModel, GetsOneSentenceThatSaysWhatIsWrong)
{
    const std::string complaint = Complaint(GetParam().text);
    EXPECT_EQ(complaint.rfind("m.toml: ", 0), 0u) << complaint;
    EXPECT_EQ(complaint.find('\n'), std::string::npos) << complaint;
    for (const std::string &word : GetParam().says)
        EXPECT_NE(complaint.find(word), std::string::npos) << "no " << word << " in: " << complaint;
}

const Bad kBad[] = {
    {"UnknownKey", "[base]\nforwardgain = 1", {"'forwardgain'", "[base]", "'forward_gain'"}},
    {"KeyOfAnotherSection", "[base]\nmass_kg = 1", {"'mass_kg'", "[base]"}},
    {"UnknownSection", "[bas]\nforward_gain = 1", {"'bas'", "'base'"}},
    {"SectionThatIsNoTable", "robot = 3", {"'robot'", "[robot]"}},
    {"RobotsThatAreNoTable", "robots = 3", {"'robots'", "[robots]"}},
    {"SectionThatIsAList", "[[base]]\nforward_gain = 1", {"'base'", "[base]"}},
    {"EffectThatIsNoList", "[effect]\nname = \"dead_zone\"", {"'effect'", "[[effect]]"}},
    {"EffectListOfNumbers", "effect = [1, 2]", {"'effect'", "[[effect]]"}},
    {"UnknownEffect", "[[effect]]\nname = \"ded_zone\"", {"effect", "'ded_zone'", "'dead_zone'"}},
    {"NamelessEffect", "[[effect]]\nwidth = 0.1", {"[[effect]]", "1", "name"}},
    {"UnknownParameter",
     "[[effect]]\nname = \"dead_zone\"\nwdth = 0.1",
     {"'wdth'", "dead_zone", "'width'"}},
    {"BelowItsBound", "[robot]\nmass_kg = -1", {"robot.mass_kg = -1 kg", "0.01 to 1000 kg"}},
    {"AboveItsBound", "[base]\nmotor_lag_s = 2.5", {"base.motor_lag_s = 2.5 s", "0 to 2 s"}},
    {"PureNumberOutOfBounds", "[base]\nyaw_gain = 9", {"base.yaw_gain = 9 is", "0.05 to 5"}},
    {"ParameterOutOfBounds",
     "[[effect]]\nname = \"input_delay\"\ndelay_s = 1.5",
     {"input_delay.delay_s = 1.5 s", "0 to 1 s"}},
    {"NotANumber", "[robot]\nmass_kg = nan", {"robot.mass_kg", "nan", "kg"}},
    {"Infinite", "[robot]\nmass_kg = inf", {"robot.mass_kg", "inf", "kg"}},
    {"InfiniteParameter",
     "[[effect]]\nname = \"marker_offset\"\nx_m = -inf",
     {"marker_offset.x_m", "-inf", "-3 to 3 m"}},
    {"NotANumberInTheTable", "[base]\nduty_pct = [0, nan]", {"base.duty_pct", "nan"}},
    {"TextForANumber", "[robot]\nmass_kg = \"1.2\"", {"robot.mass_kg", "number", "kg"}},
    {"TruthForANumber", "[robot]\nmass_kg = true", {"robot.mass_kg", "number", "kg"}},
    {"NumberForAChoice", "[base]\ndrive = 3", {"base.drive", "duty", "wheel_speed", "twist"}},
    {"UnknownDrive", "[base]\ndrive = \"duti\"", {"base.drive", "'duti'", "duty", "twist"}},
    {"UnknownWheels", "[base]\nwheels = \"six\"", {"base.wheels", "'six'", "mecanum", "omni3"}},
    {"BrokenToml", "[base]\nforward_gain = 1\nyaw_gain = = 2", {"TOML", "line 3"}},
    {"KeyTwice", "[base]\nyaw_gain = 1\nyaw_gain = 2", {"TOML", "line 3"}},
    {"DutyNotAscending",
     "[base]\nduty_pct = [0, 60, 40, 100]\nwheel_speed_mps = [0, 0.1, 0.2, 0.3]",
     {"base.duty_pct", "ascending"}},
    {"DutyTwice",
     "[base]\nduty_pct = [0, 50, 50, 100]\nwheel_speed_mps = [0, 0.1, 0.2, 0.3]",
     {"base.duty_pct", "ascending"}},
    {"DutyNotFromZero",
     "[base]\nduty_pct = [10, 100]\nwheel_speed_mps = [0, 0.3]",
     {"base.duty_pct", "from 0"}},
    {"DutyNotToFull",
     "[base]\nduty_pct = [0, 80]\nwheel_speed_mps = [0, 0.3]",
     {"base.duty_pct", "100 percent"}},
    {"DutyAboveFull",
     "[base]\nduty_pct = [0, 120]\nwheel_speed_mps = [0, 0.3]",
     {"base.duty_pct = 120 %", "0 to 100 %"}},
    {"TableOfUnequalLengths",
     "[base]\nduty_pct = [0, 100]\nwheel_speed_mps = [0, 0.1, 0.3]",
     {"base.wheel_speed_mps", "same length"}},
    {"TableThatIsNoList", "[base]\nduty_pct = 100", {"base.duty_pct", "list"}},
    {"EmptyTable", "[base]\nduty_pct = []\nwheel_speed_mps = []", {"base.duty_pct"}},
    {"MotionAtZeroDuty", "[base]\nwheel_speed_mps = [0.1, 0.3]", {"base.wheel_speed_mps"}},
    {"BackwardsAtForwardDuty",
     "[base]\nwheel_speed_mps = [0, -0.3]",
     {"base.wheel_speed_mps = -0.3 m/s", "0 to 10 m/s"}},
    {"EffectForAnotherDrive",
     "[base]\ndrive = \"twist\"\n[[effect]]\nname = \"dead_zone\"",
     {"'dead_zone'", "duties"}},
    {"UnknownNameInAFormula",
     "[[effect]]\nname = \"equation\"\nformula = \"p0*omga\"",
     {"equation.formula", "'omga'", "'omega'", "letter 4"}},
    {"FormulaThatIsNoText", "[[effect]]\nname = \"equation\"\nformula = 3", {"text"}},
    {"FormulaWithASignalsNameForANumber",
     "[[effect]]\nname = \"equation\"\nformula = \"x*vx\"\nnumbers = \"x 1/m\"",
     {"equation.numbers", "'x'", "another name"}},
    {"FormulaWithAFileKeyForANumber",
     "[[effect]]\nname = \"equation\"\nformula = \"share*vx\"\nnumbers = \"share\"",
     {"equation.numbers", "'share'", "another name"}},
    {"FormulaWithTwoNumbersOfOneName",
     "[[effect]]\nname = \"equation\"\nformula = \"k*vx\"\nnumbers = \"k, k\"",
     {"equation.numbers", "'k'", "twice"}},
    {"FormulaWithFiveNumbers",
     "[[effect]]\nname = \"equation\"\nformula = \"a*vx\"\nnumbers = \"a, b, c, d, e\"",
     {"equation.numbers", "5", "at most 4"}},
    {"FormulaCalledByNoName",
     "[[effect]]\nname = \"equation\"\ncalled = \"of air\"",
     {"equation.called", "'of air'", "no name"}},
    {"UnknownTextOfAnEffect",
     "[[effect]]\nname = \"dead_zone\"\nformula = \"p0\"",
     {"'formula'", "dead_zone"}},
    {"ValueOutsideItsOwnBounds",
     "[[effect]]\nname = \"dead_zone\"\nwidth = 0.3\nbounds = { width = [0, 0.2] }",
     {"dead_zone.width = 0.3", "0 to 0.2"}},
    {"BoundsOutsideTheEffects",
     "[[effect]]\nname = \"dead_zone\"\nbounds = { width = [0, 2] }",
     {"upper bound", "dead_zone.width = 2", "0 to 0.6"}},
    {"BoundsTheWrongWayRound",
     "[[effect]]\nname = \"dead_zone\"\nbounds = { width = [0.3, 0.2] }",
     {"upper bound", "dead_zone.width = 0.2", "0.3 to 0.6"}},
    {"BoundsOfAnUnknownParameter",
     "[[effect]]\nname = \"dead_zone\"\nbounds = { widht = [0, 0.2] }",
     {"'widht'", "bounds", "'width'"}},
    {"BoundsThatAreNoPair",
     "[[effect]]\nname = \"dead_zone\"\nbounds = { width = 0.2 }",
     {"dead_zone.width", "[min, max]"}},
    {"BoundsThatAreNoTable",
     "[[effect]]\nname = \"dead_zone\"\nbounds = [0, 1]",
     {"'bounds'", "table"}},
    {"RobotOfOneDigit", "[robots.R3]\nyaw_gain = 1", {"robots.R3", "R00 to R99"}},
    {"RobotWithALetter", "[robots.R3x]\nyaw_gain = 1", {"robots.R3x", "R00 to R99"}},
    {"RobotWithASign", "[robots.\"R+3\"]\nyaw_gain = 1", {"robots.R+3", "R00 to R99"}},
    {"RobotInLowerCase", "[robots.r03]\nyaw_gain = 1", {"robots.r03", "R00 to R99"}},
    {"RobotThatIsNoTable", "[robots]\nR03 = 1", {"robots.R03", "R00 to R99"}},
    {"UnknownOverride", "[robots.R03]\nyaw_gian = 1", {"'yaw_gian'", "robots.R03", "'yaw_gain'"}},
    {"OverrideOfTheKind", "[robots.R03]\nmass_kg = 1", {"'mass_kg'", "robots.R03"}},
    {"OverrideOfAnEffectThatIsNotThere",
     "[robots.R03]\nwheel_gain.fl = 0.1",
     {"'wheel_gain'", "[robots.R03]", "[[effect]]"}},
    {"UnknownOverrideOfAnEffect",
     "[[effect]]\nname = 'wheel_gain'\n[robots.R03]\nwheel_gain.fx = 0.1",
     {"'fx'", "wheel_gain", "fl, fr, rl, rr"}},
    {"OverrideOfAnEffectOutOfBounds",
     "[[effect]]\nname = 'wheel_gain'\n[robots.R03]\nwheel_gain.fl = 0.6",
     {"robots.R03.wheel_gain.fl = 0.6", "-0.5 to 0.5"}},
    {"OverrideOutOfBounds", "[robots.R03]\ntheta_a1 = 9", {"robots.R03.theta_a1 = 9", "0.05 to 5"}},
};

INSTANTIATE_TEST_SUITE_P(ModelFile, BadModel, testing::ValuesIn(kBad),
                         [](const auto &bad) { return bad.param.name; });

constexpr const char *kGood = R"(
name = "test robot"
description = "for tests"
parent = "0123"
created_by = "twinmill fit"
[robot]
mass_kg = 2
[base]
drive = "duty"
wheels = "mecanum"
duty_pct = [0, 50, 100]
wheel_speed_mps = [0, 0.1, 0.4]
forward_gain = 0.9
[base.std]
forward_gain = 0.01
[noise]
drive_mps = 0.01
[clock]
offset_s = -0.1
[fit]
anything = "is for people"
[robots.R03]
forward_gain = 0.8
theta_a2 = 1.1
delay_s = 0.2
[[effect]]
name = "dead_zone"
width = 0.1
std = { width = 0.01 }
fitted_on = "a.lcmlog"
error_before = 2.0
error_after = 1.1
[[effect]]
name = "marker_offset"
y_m = 0.02
[[effect]]
name = "dead_zone"
width = 0.2
)";

TEST(ModelFile, ARobotHasItsOwnValuesOfTheModelsEffects)
{
    const Model model = Parse(
        "[[effect]]\nname = 'wheel_gain'\nfl = 0\nfr = 0.01\nrl = 0\nrr = 0\n"
        "[[effect]]\nname = 'view_range'\nfactor = 0.9\n"
        "[robots.R03]\nwheel_gain.fl = -0.1\nview_range.factor = 0.5\nrange_m = 2");
    const Model third = model.ForRobot(3);
    EXPECT_EQ(third.Get("wheel_gain.fl"), -0.1);
    EXPECT_EQ(third.Get("wheel_gain.fr"), 0.01);
    EXPECT_EQ(third.MakeDetectionModel().range_m, 1.0);
    EXPECT_EQ(model.ForRobot(2).Get("wheel_gain.fl"), 0);
    Model without = model;
    without.RemoveEffect(0);
    EXPECT_EQ(without.ForRobot(3).Get("view_range.factor"), 0.5);
}

TEST(ModelFile, ReadsWhatIsThereAndLeavesTheRestAtItsDefaults)
{
    const Model model = Parse(kGood), defaults;
    EXPECT_EQ(model.robot.mass_kg, 2);
    EXPECT_EQ(model.robot.wheel_radius_m, defaults.robot.wheel_radius_m);
    EXPECT_EQ(model.base.wheel_speed_mps, (std::vector<double>{0, 0.1, 0.4}));
    EXPECT_EQ(model.base.forward_gain, 0.9);
    EXPECT_EQ(model.noise.drive_mps, 0.01);
    EXPECT_TRUE(model.clock.known);
    EXPECT_FALSE(Parse("").clock.known);
    ASSERT_EQ(model.effects.size(), 3u);
    EXPECT_STREQ(model.effects[1].spec->card.name, "marker_offset");
    EXPECT_EQ(model.effects[1].parameters[1].value, 0.02);
    EXPECT_EQ(model.effects[1].parameters[0].value,
              model.effects[1].spec->parameters[0].default_value);
}

TEST(ModelFile, AFormulaHasTheNamesAndUnitsOfItsAuthor)
{
    const std::string drag =
        "[[effect]]\nname = \"equation\"\ncalled = \"air\"\n"
        "numbers = \"drag s/m, share_of_it\"\nadds_to = \"vx_mps\"\n"
        "formula = \"-share_of_it*drag*vx*abs(vx)\"\n"
        "drag = 0.5\nshare_of_it = 2\n";
    Model model = Parse(drag + drag + "[[effect]]\nname = \"equation\"\n");
    EXPECT_EQ(model.Instances(),
              (std::vector<std::string>{"equation#air", "equation#air#2", "equation"}));
    EXPECT_EQ(model.Find("equation#air.drag").unit, "s/m");
    EXPECT_EQ(model.Find("equation#air.share_of_it").unit, "1");
    EXPECT_EQ(model.Get("equation#air#2.drag"), 0.5);
    EXPECT_NO_THROW(model.Get("equation.p3"));
    EXPECT_THROW(model.Get("equation#air.p0"), std::invalid_argument);
    const BoundEffect effect = model.effects[0].Bind();
    const RobotFacts robot;
    GroundSignals s{robot, 0, 0, false, 0, 0, 0, {}, 3, 0, 0};
    std::get<OnGround>(effect.act()).step(s, effect.numbers(), nullptr);
    EXPECT_EQ(s.vx_mps, 3 - 2 * 0.5 * 3 * 3);
}

TEST(ModelFile, OneClockIsDeclaredAndNotContradicted)
{
    const Model model = Parse("[clock]\nsame = true");
    EXPECT_TRUE(model.clock.known);
    EXPECT_TRUE(model.clock.same);
    EXPECT_FALSE(Parse("[clock]\noffset_s = 0.1").clock.same);
    EXPECT_FALSE(Parse("[clock]\nsame = false\noffset_s = 0.1").clock.same);
    EXPECT_THROW(Parse("[clock]\nsame = true\noffset_s = 0.1"), std::invalid_argument);
    EXPECT_THROW(Parse("[clock]\nsame = 1"), std::invalid_argument);
    EXPECT_THROW(Parse("[clock]\nsane = true"), std::invalid_argument);
}

TEST(ModelFile, ReadsFormulasAndNarrowerBounds)
{
    Model model = Parse(
        "[[effect]]\nname = \"equation\"\nadds_to = \"vy_mps\"\nformula = \"p0*vx\"\n"
        "p0 = 0.5\nbounds = { p0 = [-1, 1] }");
    EXPECT_EQ(model.effects[0].texts,
              (std::vector<std::string>{"vy_mps", "p0*vx", "", "", "", ""}));
    model.Set("equation.p0", 1);
    EXPECT_THROW(model.Set("equation.p0", 1.1), std::invalid_argument);
    model.Set("equation.p1", 1.1);
    const BoundEffect effect = model.effects[0].Bind();
    const RobotFacts robot;
    GroundSignals s{robot, 0, 0, false, 0, 0, 0, {}, 2, 0, 0};
    std::get<OnGround>(effect.act()).step(s, effect.numbers(), nullptr);
    EXPECT_EQ(s.vy_mps, 2);
}

TEST(ModelFile, AddsAnEffectWithTextsOrWithItsOwn)
{
    Model model;
    model.AddEffect("equation", {{"formula", "p0*vy"}});
    EXPECT_EQ(model.effects[0].texts,
              (std::vector<std::string>{"vx_mps", "p0*vy", "", "", "", ""}));
    EXPECT_THROW(model.AddEffect("equation", {{"formula", "p0*"}}), std::invalid_argument);
    EXPECT_THROW(model.AddEffect("equation", {{"formla", "p0"}}), std::invalid_argument);
    EXPECT_THROW(model.AddEffect("dead_zone", {{"formula", "p0"}}), std::invalid_argument);
    EXPECT_EQ(model.effects.size(), 1u);
}

TEST(ModelFile, TakesWholeNumbersForReals)
{
    EXPECT_EQ(Parse("[robot]\nmass_kg = 3").robot.mass_kg, 3);
}

TEST(ModelFile, NamesEveryQuantityOnceWithinItsBounds)
{
    std::set<std::string> names;
    for (const Parameter &value : Parse(kGood).Parameters())
    {
        EXPECT_TRUE(names.insert(value.name).second) << value.name << " twice";
        EXPECT_FALSE(value.unit.empty()) << value.name;
        EXPECT_TRUE(value.min <= value.value && value.value <= value.max) << value.name;
    }
    for (const char *name : {"base.forward_gain", "base.wheel_speed_mps.2", "dead_zone.width",
                             "dead_zone#2.width", "marker_offset.y_m", "theta_a1"})
        EXPECT_TRUE(names.contains(name)) << name;
}

TEST(ModelFile, GetsBackWhatWasSetUnderEveryName)
{
    Model model = Parse(kGood);
    for (const Parameter &value : model.Parameters())
    {
        const double middle = (value.min + value.max) / 2;
        model.Set(value.name, middle);
        EXPECT_EQ(model.Get(value.name), middle) << value.name;
    }
    EXPECT_EQ(model.effects[0].parameters[0].value, 0.3);
    EXPECT_EQ(model.effects[2].parameters[0].value, 0.3);
}

TEST(ModelFile, SetsTheSecondOfTwoEffectsAlone)
{
    Model model = Parse(kGood);
    model.Set("dead_zone#2.width", 0.25);
    EXPECT_EQ(model.Get("dead_zone.width"), 0.1);
    EXPECT_EQ(model.effects[2].parameters[0].value, 0.25);
    model.RemoveEffect(0);
    EXPECT_EQ(model.Get("dead_zone.width"), 0.25);
    EXPECT_THROW(model.Get("dead_zone#2.width"), std::invalid_argument);
    EXPECT_THROW(model.RemoveEffect(2), std::invalid_argument);
}

TEST(ModelFile, RefusesToSetWhatItWouldNotRead)
{
    Model model;
    const double infinite = std::numeric_limits<double>::infinity();
    for (const double bad : {-1.0, 2.5, infinite, -infinite, std::nan("")})
        EXPECT_THROW(model.Set("base.motor_lag_s", bad), std::invalid_argument) << bad;
    EXPECT_EQ(model.base.motor_lag_s, 0);
    EXPECT_THROW(model.Set("base.motor_lag", 0), std::invalid_argument);
    EXPECT_THROW(model.Get("base.motor_lag"), std::invalid_argument);
    try
    {
        model.Set("base.motor_lag_s", 2.5);
    }
    catch (const std::invalid_argument &error)
    {
        EXPECT_NE(std::string(error.what()).find("2.5 s is outside 0 to 2 s"), std::string::npos)
            << error.what();
    }
}

TEST(ModelFile, AddsEffectsAtNeutral)
{
    Model model;
    model.AddEffect("coasting");
    EXPECT_EQ(model.effects[0].parameters[0].value, model.effects[0].spec->parameters[0].neutral);
    EXPECT_THROW(model.AddEffect("no_such"), std::invalid_argument);
    model.base.drive = Drive::kWheelSpeed;
    EXPECT_THROW(model.AddEffect("coasting"), std::invalid_argument);
    model.AddEffect("wheel_gain");
    EXPECT_EQ(model.effects.size(), 2u);
}

TEST(ModelFile, GivesEachRobotItsOwn)
{
    const Model model = Parse(kGood), third = model.ForRobot(3), fourth = model.ForRobot(4);
    EXPECT_EQ(third.base.forward_gain, 0.8);
    EXPECT_EQ(third.theta_a2, 1.1);
    EXPECT_EQ(third.sensor.delay_s, 0.2);
    EXPECT_EQ(third.robot.mass_kg, 2);
    EXPECT_EQ(third.effects.size(), 3u);
    EXPECT_EQ(fourth.base.forward_gain, 0.9);
    EXPECT_EQ(fourth.theta_a2, 1);
    EXPECT_EQ(model.base.forward_gain, 0.9);
}

TEST(ModelFile, TakesASteeredRobotWithCommandsThatSayWhereItSteers)
{
    const Model model = Parse(
        "[robot]\nmax_steering_rad = 0.4\n[base]\nwheels = \"ackermann\"\ndrive = \"steering\"\n");
    EXPECT_EQ(model.base.wheels, WheelKind::kAckermann);
    EXPECT_EQ(model.base.drive, Drive::kSteering);
    EXPECT_THROW(Parse("[base]\nwheels = \"ackermann\"\n"), std::invalid_argument);
    EXPECT_THROW(Parse("[base]\ndrive = \"steering\"\n"), std::invalid_argument);
}

TEST(ModelFile, NamesWhatDoesNotActInAPlant)
{
    const Model model = Parse("[robot]\nmass_kg = 3\n");
    ASSERT_EQ(model.InertIn(PlantKind::kPlanar).size(), 1u);
    EXPECT_EQ(model.InertIn(PlantKind::kPlanar)[0].name, "robot.mass_kg");
    EXPECT_TRUE(model.InertIn(PlantKind::kMujoco).empty());
    EXPECT_TRUE(Model().InertIn(PlantKind::kPlanar).empty());
}

}  // namespace
}  // namespace twin::test

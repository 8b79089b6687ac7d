// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <stdexcept>

#include "drive.h"

namespace twin::test
{
namespace
{

const std::vector<double> kNeutral{0, 0, 0, 0};

Alone Formula(const std::string &adds_to, const std::string &formula, const std::string &rate = "",
              const std::string &second_rate = "")
{
    const std::vector<std::string> texts{adds_to, formula, rate, second_rate};
    return Alone(BoundEffect(*FindEffect("equation"), kNeutral, texts));
}

std::string Complaint(const std::string &adds_to, const std::string &formula,
                      const std::string &rate = "", const std::string &second_rate = "")
{
    try
    {
        Formula(adds_to, formula, rate, second_rate);
    }
    catch (const std::invalid_argument &error)
    {
        return error.what();
    }
    return "accepted";
}

Model WithFormula(const std::string &adds_to, const std::string &formula,
                  const std::vector<double> &values, const std::string &rate = "", Model model = {},
                  const std::string &second_rate = "")
{
    model.AddEffect("equation", {{"adds_to", adds_to},
                                 {"formula", formula},
                                 {"state_rate", rate},
                                 {"second_rate", second_rate}});
    for (size_t i = 0; i < values.size(); ++i)
        model.effects.back().parameters[i].value = values[i];
    return model;
}

// Effects of the catalogue, written as formulas, give the same drive.
TEST(Equation, CanSayWhatOtherEffectsSay)
{
    const struct
    {
        const char *adds_to, *formula;
        std::vector<double> values;
        Model same;
    } cases[] = {
        {"rim_mps",
         "target*(left > 0 ? p0 : p1)*(target < 0 ? 1 : 0)",
         {0.1, -0.2},
         With("reverse_asymmetry", {0.1, -0.2})},
        {"rim_mps", "p0*target*(V/7.4 - 1)", {1}, With("battery_sag", {1})},
        {"duty", "p0*u*(1 - abs(u))", {0.4}, With("speed_curve", {0.4, 0})},
        {"omega_radps", "p0*abs(omega)", {0.1}, With("turn_asymmetry", {0.1})},
    };
    for (const auto &c : cases)
    {
        Player formula(WithFormula(c.adds_to, c.formula, c.values), 0.02), effect(c.same, 0.02);
        PlayMedley(formula);
        PlayMedley(effect);
        EXPECT_NEAR(formula.state.pose.x_m, effect.state.pose.x_m, 1e-12) << c.formula;
        EXPECT_NEAR(formula.state.pose.y_m, effect.state.pose.y_m, 1e-12) << c.formula;
        EXPECT_NEAR(formula.state.pose.theta_rad, effect.state.pose.theta_rad, 1e-12) << c.formula;
    }
}

// heat_gain's own equation: h(t) = u^2 (1 - exp(-t / 60 s)) on the speed that the wheel tends to.
TEST(Equation, RemembersAsTheEffectOfWarmMotorsDoes)
{
    Player formula(WithFormula("rim_mps", "p0*s*target", {-0.2}, "(u*u - s)/60"), 0.02);
    Player effect(With("heat_gain", {0.2}), 0.02);
    for (Player *player : {&formula, &effect})
    {
        player->Play(kForward, 40);
        PlayMedley(*player);
        player->Play({1, 0.2, 1, 0.2}, 20);
    }
    EXPECT_NEAR(formula.state.pose.x_m, effect.state.pose.x_m, 1e-9);
    EXPECT_NEAR(formula.state.pose.y_m, effect.state.pose.y_m, 1e-9);
    EXPECT_NEAR(formula.state.pose.theta_rad, effect.state.pose.theta_rad, 1e-9);
}

// Stored way s goes to d sign(v) with the way driven: s = d (1 - exp(-way / d)), and of what is
// driven v - |v| s / d is lost, which adds up to s; at any step, be it long against d / v.
TEST(Equation, IntegratesAStiffStateExactly)
{
    constexpr double kReach_m = 0.003;
    for (const double step_s : {0.002, 0.02, 0.1})
    {
        Player player(
            WithFormula("vx_mps", "p0*(vx - abs(vx)*s/0.003)", {-1}, "vx - abs(vx)*s/0.003"),
            step_s);
        player.Play(kForward, 0.2);
        const double way_m = 0.2 * kFull_mps;
        const double stored_m = kReach_m * (1 - std::exp(-way_m / kReach_m));
        EXPECT_NEAR(player.state.pose.x_m, way_m - stored_m, 1e-9) << step_s;
        // Turned round, the way back gives the stored way twice, as far as e^-24 is nothing.
        player.Play(kBack, 0.2);
        EXPECT_NEAR(player.state.pose.x_m, -stored_m + 2 * kReach_m, 1e-9) << step_s;
    }
}

// A step answered by an underdamped oscillator of w = 8 rad/s and z = 0.2, by its textbook solution
// (Franklin et al. 2010, sec. 3.3), at steps of the plant up to a third of its period.
TEST(Equation, SwingsWithTwoStatesAsTheTextbookSays)
{
    constexpr double kW = 8, kZ = 0.2, kFor_s = 1.4;
    const double wd = kW * std::sqrt(1 - kZ * kZ), fade = std::exp(-kZ * kW * kFor_s);
    const double rate_mps2 = kFull_mps * kW * kW / wd * fade * std::sin(wd * kFor_s);
    const double left_mps =
        kFull_mps * fade * (std::cos(wd * kFor_s) + kZ * kW / wd * std::sin(wd * kFor_s));
    // Of s'' = w^2 (v - s) - 2 z w s' integrated: the way that s lags behind.
    const double behind_m = (2 * kZ * kW * (kFull_mps - left_mps) + rate_mps2) / (kW * kW);
    for (const double step_s : {0.002, 0.02, 0.28})
    {
        Player player(WithFormula("vx_mps", "p0*(s - vx)", {1}, "r", {}, "64*(vx - s) - 3.2*r"),
                      step_s);
        player.Play(kForward, kFor_s);
        EXPECT_NEAR(player.state.pose.x_m, kFull_mps * kFor_s - behind_m, 1e-8) << step_s;
    }
}

// Two lags in a row are two states, too, and a stiff one among them.
TEST(Equation, RelaxesWithTwoStatesAsTheEffectOfTwoLagsDoes)
{
    Model lagging;
    lagging.base.motor_lag_s = 0.1;
    Player two(WithFormula("rim_mps", "p0*(r - target)", {1}, "(target - s)/0.05", lagging,
                           "(s - r)/0.0001"),
               0.02);
    lagging.AddEffect("second_order_lag", {});
    lagging.effects.back().parameters[0].value = 0.05;
    Player effect(lagging, 0.02);
    PlayMedley(two);
    PlayMedley(effect);
    EXPECT_NEAR(two.state.pose.x_m, effect.state.pose.x_m, 2e-4);
    EXPECT_NEAR(two.state.pose.theta_rad, effect.state.pose.theta_rad, 2e-3);
}

TEST(Equation, KeepsAStateWhoseRateHasNoValue)
{
    Player player(WithFormula("vx_mps", "p0*(1 + s)", {0.1}, "1/vy"), 0.02);
    player.Play(kForward, 1);
    EXPECT_NEAR(player.state.pose.x_m, kFull_mps + 0.1, 1e-12);
}

TEST(Equation, ChangesWayAndMotionByAShare)
{
    Player usual(Model{}, 0.02), travel(WithFormula("travel", "p0", {-0.25}), 0.02),
        motion(WithFormula("motion", "p0", {-0.25}), 0.02);
    for (Player *player : {&usual, &travel, &motion})
        player->Play({0.3, 0.9, 0.3, 0.9}, 1);
    EXPECT_NEAR(travel.state.vx_mps, 0.75 * usual.state.vx_mps, 1e-12);
    EXPECT_NEAR(travel.state.omega_radps, usual.state.omega_radps, 1e-12);
    EXPECT_NEAR(motion.state.vx_mps, 0.75 * usual.state.vx_mps, 1e-12);
    EXPECT_NEAR(motion.state.omega_radps, 0.75 * usual.state.omega_radps, 1e-12);
}

TEST(Equation, LeadsAsideByTheCourse)
{
    Player usual(Model{}, 0.02), aside(WithFormula("aside", "p0*cos(course - theta)", {0.1}), 0.02);
    for (Player *player : {&usual, &aside})
        player->Play(kForward, 0.5);
    EXPECT_NEAR(aside.state.vx_mps, usual.state.vx_mps, 1e-12);
    EXPECT_NEAR(aside.state.vy_mps, 0.1 * usual.state.vx_mps, 1e-12);
}

TEST(Equation, PushesAlongTheRoomWhereverTheRobotLooks)
{
    for (const double theta_rad : {0.0, 0.7, -2.0})
    {
        Signals s;
        s.vx_mps = 0.3, s.vy_mps = 0.4, s.theta_rad = theta_rad;
        Signals pushed = s;
        Formula("room_mps", "0.1*sqrt(vx*vx + vy*vy), 2*vx").Step(pushed, nullptr);
        const double ahead = pushed.vx_mps - s.vx_mps, left = pushed.vy_mps - s.vy_mps;
        const double c = std::cos(theta_rad), si = std::sin(theta_rad);
        EXPECT_NEAR(c * ahead - si * left, 0.05, 1e-12);
        EXPECT_NEAR(si * ahead + c * left, 0.6, 1e-12);
    }
}

// A marker that sways is driven by the robot's velocity in the room: along x and along y it does
// what it does along one axis, whichever way the robot looks.
TEST(Equation, KeepsStatesAlongEachAxisOfTheRoom)
{
    const std::string x = "(vx*cos(theta) - vy*sin(theta))", y = "(vx*sin(theta) + vy*cos(theta))";
    const std::string swing = "49*(VX - s) - 1.4*r, 49*(VY - s) - 1.4*r";
    const auto placed = [&](std::string text) {
        text.replace(text.find("VX"), 2, x);
        return text.replace(text.find("VY"), 2, y);
    };
    Player along(WithFormula("vx_mps", "p0*(s - vx)", {0.5}, "r", {}, "49*(vx - s) - 1.4*r"), 0.02);
    Player room(WithFormula("room_mps", placed("p0*(s - VX), p1*(s - VY)"), {0.5, 0.5}, "r", {},
                            placed(swing)),
                0.02);
    room.state.pose.theta_rad = 0.9;
    for (Player *player : {&along, &room})
        player->Play(kForward, 0.7);
    EXPECT_NEAR(room.state.pose.x_m, along.state.pose.x_m * std::cos(0.9), 1e-12);
    EXPECT_NEAR(room.state.pose.y_m, along.state.pose.x_m * std::sin(0.9), 1e-12);
}

TEST(Equation, MovesTheCapturedHeadingAndBack)
{
    const DriveChain chain(WithFormula("theta_rad", "p0*sin(theta + 1)", {0.2}));
    for (const double theta_rad : {-3.0, 0.0, 0.7, 2.5, 9.0})
    {
        Pose2 pose{1, 2, theta_rad};
        double t_s = 0;
        chain.Observe(pose, t_s);
        EXPECT_NEAR(pose.theta_rad, theta_rad + 0.2 * std::sin(theta_rad + 1), 1e-12);
        chain.Invert(pose, t_s);
        EXPECT_NEAR(pose.theta_rad, theta_rad, 1e-9);
    }
}

TEST(Equation, KnowsEveryQuantityByItsName)
{
    Signals s;
    s.t_s = 2;
    s.battery_V = 3;
    s.duty = {5, 7, 11, 13};
    s.rim_mps = {17, 19, 23, 29};
    s.wheel_rad = {31, 37, 41, 43};
    s.vx_mps = 47, s.vy_mps = 53, s.omega_radps = 59;
    s.x_m = 61, s.y_m = 67, s.theta_rad = 71, s.moves = true;
    const struct
    {
        const char *adds_to, *formula;
        double Signals::*body;
        double expected;
    } body[] = {{"vx_mps", "vy*x + t", &Signals::vx_mps, 47 + 53 * 61 + 2},
                {"vy_mps", "vx*y", &Signals::vy_mps, 53 + 47 * 67},
                {"omega_radps", "moves*theta/omega", &Signals::omega_radps, 59 + 71.0 / 59}};
    for (const auto &c : body)
    {
        Signals after = s;
        Formula(c.adds_to, c.formula).Step(after, nullptr);
        EXPECT_DOUBLE_EQ(after.*c.body, c.expected) << c.formula;
    }
    Signals after = s;
    Formula("rim_mps", "rim + 100*left + 1000*front + u*V + angle").Step(after, nullptr);
    EXPECT_EQ(after.target_mps, (Wheels{17 + 1100 + 15 + 31, 19 + 900 + 21 + 37, 23 - 900 + 33 + 41,
                                        29 - 1100 + 39 + 43}));
    Formula("duty", "left*t").Step(s, nullptr);
    EXPECT_EQ(s.duty, (Wheels{7, 5, 13, 11}));
}

TEST(Equation, AddsNothingWhereItHasNoValue)
{
    for (const char *formula : {"sqrt(vy - 1)", "1/vy", "ln(vy)"})
    {
        Signals s;
        s.vx_mps = 0.25;
        Formula("vx_mps", formula).Step(s, nullptr);
        EXPECT_EQ(s.vx_mps, 0.25) << formula;
    }
}

// tan t passes all bounds at pi / 2, by calculus; it had been as if there were no formula then.
TEST(Equation, IsNotSilentWhereItsStateGrowsWithoutBound)
{
    for (const double step_s : {0.005, 0.02, 0.025, 0.05})
    {
        Player one(WithFormula("vx_mps", "p0*s", {0.01}, "s*s + 1"), step_s);
        Player two(WithFormula("vx_mps", "p0*s", {0.01}, "r", {}, "s*s*s + 1"), step_s);
        for (Player *player : {&one, &two})
        {
            player->Play(kForward, 5);
            EXPECT_GT(player->state.pose.x_m, 1e9) << step_s;
        }
    }
}

TEST(Equation, SaysWhatIsWrongAndWhere)
{
    const struct
    {
        const char *adds_to, *formula;
        std::vector<std::string> says;
    } cases[] = {
        {"vz_mps", "p0", {"equation.adds_to", "'vz_mps'", "'v"}},
        {"vx_mps", "p0*omga", {"equation.formula", "'p0*omga'", "'omga'", "'omega'", "letter 4"}},
        {"vx_mps", "sine(vx)", {"'sine'", "'sin", "letter 1"}},
        {"vx_mps", "u*p0", {"'u'", "letter 1"}},
        {"duty", "vx", {"'vx'", "letter 1"}},
        {"vx_mps", "p0*(vx + 1", {"arenthesis"}},
        {"vx_mps", "p0 vx", {"vx", "letter 4"}},
        {"vx_mps", "p0*", {"end of expression", "letter 4"}},
        {"vx_mps", "", {"empty"}},
        {"vx_mps", "vx = 2", {"letter 4"}},
        {"vx_mps", "vx, vy", {"one value"}},
        {"room_mps", "vx", {"two values"}},
        {"vx_mps", "\"p0\"", {"letter 1"}},
        {"vx_mps", "max()", {"max", "letter"}},
    };
    for (const auto &c : cases)
    {
        const std::string complaint = Complaint(c.adds_to, c.formula);
        EXPECT_EQ(complaint.rfind("equation.", 0), 0u) << complaint;
        EXPECT_EQ(complaint.find('\n'), std::string::npos) << complaint;
        for (const std::string &word : c.says)
            EXPECT_NE(complaint.find(word), std::string::npos) << word << " in: " << complaint;
    }
}

TEST(Equation, SaysWhatIsWrongWithAState)
{
    for (const char *word : {"equation.state_rate", "'omga'", "'omega'", "letter 1"})
        EXPECT_NE(Complaint("vx_mps", "p0*s", "omga").find(word), std::string::npos) << word;
    EXPECT_NE(Complaint("duty", "p0*s", "u - s").find("rim_mps"), std::string::npos);
    EXPECT_NE(Complaint("theta_rad", "p0*s", "x - s").find("no state"), std::string::npos);
    EXPECT_NE(Complaint("vx_mps", "p0*s").find("'s'"), std::string::npos);
    EXPECT_NE(Complaint("vx_mps", "p0*r", "vx - s").find("'r'"), std::string::npos);
    for (const char *word : {"equation.second_rate", "'omga'", "'omega'", "letter 3"})
        EXPECT_NE(Complaint("vx_mps", "p0*s", "r", "s*omga").find(word), std::string::npos) << word;
    EXPECT_NE(Complaint("vx_mps", "p0*vx", "", "vx - r").find("state_rate"), std::string::npos);
}

TEST(Equation, ComparesWithoutAssigning)
{
    for (const char *formula : {"vx == 2 ? p0 : 0", "vx <= 2", "vx >= 2", "vx != 2"})
        EXPECT_EQ(Complaint("vx_mps", formula), "accepted") << formula;
}

}  // namespace
}  // namespace twin::test

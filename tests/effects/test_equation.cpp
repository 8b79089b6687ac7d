// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <stdexcept>

#include "drive.h"

namespace twin::test
{
namespace
{

const std::vector<double> kNeutral{0, 0, 0, 0};

Alone Formula(const std::string &adds_to, const std::string &formula)
{
    return Alone(
        BoundEffect(*FindEffect("equation"), kNeutral, std::vector<std::string>{adds_to, formula}));
}

std::string Complaint(const std::string &adds_to, const std::string &formula)
{
    try
    {
        Formula(adds_to, formula);
    }
    catch (const std::invalid_argument &error)
    {
        return error.what();
    }
    return "accepted";
}

Model WithFormula(const std::string &adds_to, const std::string &formula,
                  const std::vector<double> &values, Model model = {})
{
    model.AddEffect("equation", {{"adds_to", adds_to}, {"formula", formula}});
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

TEST(Equation, ComparesWithoutAssigning)
{
    for (const char *formula : {"vx == 2 ? p0 : 0", "vx <= 2", "vx >= 2", "vx != 2"})
        EXPECT_EQ(Complaint("vx_mps", formula), "accepted") << formula;
}

}  // namespace
}  // namespace twin::test

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>
#include <stdexcept>
#include <vector>

#include <muParser.h>

#include "effects/nearest.h"
#include "make.h"

namespace twin
{
namespace
{

constexpr Card kCard = {
    .name = "equation",
    .stage = Stage::kGround,
    .drives = kAnyDrive,
    .summary = "A formula of one's own is added to a quantity of the drive.",
    .equation =
        "adds_to' = adds_to + formula(p0, p1, p2, p3, ...). Per wheel, duty: u (duty or command), "
        "V (battery), left and front (1 or -1), t (s); rim_mps, speed the wheel tends to: these, "
        "target and rim (m/s, now), angle (rad). Body: vx, vy (m/s), omega (rad/s), x, y (m), "
        "theta (rad), moves (0 or 1), t (s). Functions: abs sign min max sqrt exp ln sin cos tan "
        "asin acos atan atan2 sinh cosh tanh and more of muParser; a ? b : c; _pi",
    .leaves_out = "memory; where the formula has no finite value, nothing is added",
    .measure = "whatever drive varies the quantities in the formula; what it resembles is its own",
    .reference = "muParser (the parser); the formula is the user's",
    .family = Family::kFormula,
    .needs = Needs::kSteadySpeed,
    .phrase = "a formula of its own",
};

constexpr Parameter kParameters[] = {
    {"p0", "1", 0, 0.01, -10, 10, "p0 of the formula, in the unit that it gives it"},
    {"p1", "1", 0, 0.01, -10, 10, "p1 of the formula"},
    {"p2", "1", 0, 0.01, -10, 10, "p2 of the formula"},
    {"p3", "1", 0, 0.01, -10, 10, "p3 of the formula"},
};

constexpr TextParameter kTexts[] = {
    {"adds_to", "vx_mps", "one of duty, rim_mps (per wheel), vx_mps, vy_mps, omega_radps (body)"},
    {"formula", "p0*vx + p1*vy + p2*omega + p3*vx*abs(vx)",
     "what is added, in the unit of adds_to; should be 0 where p0 to p3 are"},
};

// A name in formulas, and its value for wheel k (0 for the body).
struct Name
{
    const char *name;
    double (*value)(const Signals &s, int k);
};

constexpr Name kTime = {"t", [](const Signals &s, int) { return s.t_s; }};
constexpr Name kCommand = {"u", [](const Signals &s, int k) { return s.duty[k]; }};
constexpr Name kVoltage = {"V", [](const Signals &s, int) { return s.battery_V; }};
constexpr Name kLeft = {"left", [](const Signals &, int k) { return k % 2 ? -1.0 : 1.0; }};
constexpr Name kFront = {"front", [](const Signals &, int k) { return k < 2 ? 1.0 : -1.0; }};

constexpr Name kDutyNames[] = {kCommand, kVoltage, kLeft, kFront, kTime};
constexpr Name kWheelNames[] = {
    kCommand,
    kVoltage,
    kLeft,
    kFront,
    kTime,
    {"rim", [](const Signals &s, int k) { return s.rim_mps[k]; }},
    {"target", [](const Signals &s, int k) { return s.target_mps[k]; }},
    {"angle", [](const Signals &s, int k) { return s.wheel_rad[k]; }},
};
constexpr Name kBodyNames[] = {
    kTime,
    {"vx", [](const Signals &s, int) { return s.vx_mps; }},
    {"vy", [](const Signals &s, int) { return s.vy_mps; }},
    {"omega", [](const Signals &s, int) { return s.omega_radps; }},
    {"x", [](const Signals &s, int) { return s.x_m; }},
    {"y", [](const Signals &s, int) { return s.y_m; }},
    {"theta", [](const Signals &s, int) { return s.theta_rad; }},
    {"moves", [](const Signals &s, int) { return s.moves ? 1.0 : 0.0; }},
};

// A quantity that a formula may add to.
struct Quantity
{
    const char *name;
    Stage stage;
    int wheels;  // how many there are of it
    std::span<const Name> names;
    double &(*at)(Signals &s, int k);
};

constexpr Quantity kQuantities[] = {
    {"duty", Stage::kDuty, kWheels, kDutyNames,
     [](Signals &s, int k) -> double & { return s.duty[k]; }},
    {"rim_mps", Stage::kWheel, kWheels, kWheelNames,
     [](Signals &s, int k) -> double & { return s.target_mps[k]; }},
    {"vx_mps", Stage::kGround, 1, kBodyNames, [](Signals &s, int) -> double & { return s.vx_mps; }},
    {"vy_mps", Stage::kGround, 1, kBodyNames, [](Signals &s, int) -> double & { return s.vy_mps; }},
    {"omega_radps", Stage::kGround, 1, kBodyNames,
     [](Signals &s, int) -> double & { return s.omega_radps; }},
};

const Quantity &FindQuantity(const std::string &name)
{
    std::set<std::string> known;
    for (const Quantity &quantity : kQuantities)
    {
        if (name == quantity.name)
            return quantity;
        known.insert(quantity.name);
    }
    throw std::invalid_argument("equation.adds_to = '" + name +
                                "' is unknown; the nearest known is '" + Nearest(name, known) +
                                "'");
}

// The parser's complaint as one sentence, positions counted from 1.
[[noreturn]] void Fail(const std::string &formula, int position, const std::string &what)
{
    const int end = static_cast<int>(formula.size());
    const std::string where =
        position < 0 ? "" : " at letter " + std::to_string(std::min(position, end) + 1);
    throw std::invalid_argument("equation.formula = '" + formula + "': " + what + where);
}

// The same for one that the parser found.
[[noreturn]] void Fail(const mu::Parser &parser, const mu::ParserError &error,
                       const std::string &formula)
{
    const std::string &token = error.GetToken();
    if (error.GetCode() != mu::ecUNASSIGNABLE_TOKEN || !(std::isalpha(token[0]) || token[0] == '_'))
    {
        std::string what = error.GetMsg().substr(0, error.GetMsg().find(" at position"));
        what = what.substr(0, what.find_last_not_of(".!") + 1);
        Fail(formula, error.GetPos(), what);
    }
    std::set<std::string> known;
    for (const auto &[name, address] : parser.GetVar())
        known.insert(name);
    for (const auto &[name, value] : parser.GetConst())
        known.insert(name);
    for (const auto &[name, function] : parser.GetFunDef())
        known.insert(name);
    Fail(formula, error.GetPos(),
         "unknown name '" + token + "', the nearest known is '" + Nearest(token, known) + "',");
}

// Steps write the formula's variables: one thread at a time, as for the state.
class Equation final : public Effect
{
public:
    explicit Equation(std::span<const double> v)
        : Equation(v, std::vector<std::string>{kTexts[0].default_value, kTexts[1].default_value})
    {
    }

    Equation(std::span<const double> v, std::span<const std::string> texts)
        : quantity_(FindQuantity(texts[0])), value_(quantity_.names.size())
    {
        for (size_t i = 0; i < v.size(); ++i)
            parser_.DefineConst(kParameters[i].name, v[i]);
        for (size_t i = 0; i < value_.size(); ++i)
            parser_.DefineVar(quantity_.names[i].name, &value_[i]);
        Parse(texts[1]);
    }

    Stage ActsAt(const Card &) const override { return quantity_.stage; }

    void Step(Signals &s, double *) const override
    {
        for (int k = 0; k < quantity_.wheels; ++k)
        {
            for (const size_t i : used_)
                value_[i] = quantity_.names[i].value(s, k);
            const double added = parser_.Eval();
            if (std::isfinite(added))
                quantity_.at(s, k) += added;
        }
    }

private:
    void Parse(const std::string &formula)
    {
        // The parser would take these for assignments and texts.
        for (size_t i = 0; i < formula.size(); ++i)
        {
            const bool compares = (i > 0 && std::string("=<>!").find(formula[i - 1]) < 4) ||
                                  (i + 1 < formula.size() && formula[i + 1] == '=');
            if (formula[i] == '"' || formula[i] == '\n' || (formula[i] == '=' && !compares))
                Fail(formula, static_cast<int>(i), "only numbers are computed here, not this sign");
        }
        try
        {
            parser_.SetExpr(formula);
            int results = 0;
            parser_.Eval(results);
            if (results != 1)
                Fail(formula, -1, "it must be one value, not a list of them");
            const mu::varmap_type used = parser_.GetUsedVar();
            for (size_t i = 0; i < value_.size(); ++i)
                if (used.contains(quantity_.names[i].name))
                    used_.push_back(i);
        }
        catch (const mu::ParserError &error)
        {
            Fail(parser_, error, formula);
        }
    }

    const Quantity &quantity_;
    mutable std::vector<double> value_;  // of each name, where the parser looks
    std::vector<size_t> used_;           // places in it
    mu::Parser parser_;
};

std::unique_ptr<Effect> MakeWithTexts(std::span<const double> values,
                                      std::span<const std::string> texts)
{
    return std::make_unique<Equation>(values, texts);
}

}  // namespace

extern const EffectSpec kEquation;
const EffectSpec kEquation = {kCard, kParameters, Make<Equation>, kTexts, MakeWithTexts};

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>
#include <stdexcept>

#include <muParser.h>

#include "effects/effect.h"
#include "effects/nearest.h"

namespace twin
{

// A parsed formula and the places where its parser looks for the values of its names. Evaluating
// writes them: one thread at a time, as for the state.
class Formula
{
public:
    Formula(std::span<const char *const> names, std::span<const double> parameters,
            const std::string &text);

    // Places in the list of names that the text uses.
    std::span<const size_t> used() const { return used_; }
    double &operator[](size_t name) { return values_[name]; }
    double Evaluate() const { return parser_.Eval(); }

private:
    void Parse(std::span<const char *const> names, const std::string &text);

    std::vector<double> values_;
    std::vector<size_t> used_;
    mu::Parser parser_;
};

namespace
{

constexpr Card kCard = {
    .name = "equation",
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

constexpr ParameterSpec kParameters[] = {
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

// A name in formulas, and its value for wheel k.
template <class S>
struct Name
{
    const char *name;
    double (*value)(const S &s, int k);
};

constexpr Name<DutySignals> kDutyNames[] = {
    {"u", [](const DutySignals &s, int k) { return s.duty[k]; }},
    {"V", [](const DutySignals &s, int) { return s.battery_V; }},
    {"left", [](const DutySignals &s, int k) { return s.robot.left[k]; }},
    {"front", [](const DutySignals &s, int k) { return s.robot.front[k]; }},
    {"t", [](const DutySignals &s, int) { return s.t_s; }},
};
constexpr Name<WheelSignals> kWheelNames[] = {
    {"u", [](const WheelSignals &s, int k) { return s.duty[k]; }},
    {"V", [](const WheelSignals &s, int) { return s.battery_V; }},
    {"left", [](const WheelSignals &s, int k) { return s.robot.left[k]; }},
    {"front", [](const WheelSignals &s, int k) { return s.robot.front[k]; }},
    {"t", [](const WheelSignals &s, int) { return s.t_s; }},
    {"rim", [](const WheelSignals &s, int k) { return s.rim_mps[k]; }},
    {"target", [](const WheelSignals &s, int k) { return s.target_mps[k]; }},
    {"angle", [](const WheelSignals &s, int k) { return s.wheel_rad[k]; }},
};
constexpr Name<GroundSignals> kBodyNames[] = {
    {"t", [](const GroundSignals &s, int) { return s.t_s; }},
    {"vx", [](const GroundSignals &s, int) { return s.vx_mps; }},
    {"vy", [](const GroundSignals &s, int) { return s.vy_mps; }},
    {"omega", [](const GroundSignals &s, int) { return s.omega_radps; }},
    {"x", [](const GroundSignals &s, int) { return s.x_m; }},
    {"y", [](const GroundSignals &s, int) { return s.y_m; }},
    {"theta", [](const GroundSignals &s, int) { return s.theta_rad; }},
    {"moves", [](const GroundSignals &s, int) { return s.moves ? 1.0 : 0.0; }},
};

// Adds the formula's value to one quantity; where it has no finite value, nothing.
template <class S>
void Add(std::span<const Name<S>> names, S &s, int k, Formula &formula, double &quantity)
{
    for (const size_t i : formula.used())
        formula[i] = names[i].value(s, k);
    const double added = formula.Evaluate();
    if (std::isfinite(added))
        quantity += added;
}

void AddToDuty(DutySignals &s, const Numbers &v, double *)
{
    for (int k = 0; k < kMaxWheels; ++k)  // a velocity command has three parts on any robot
        Add<DutySignals>(kDutyNames, s, k, *v.formula, s.duty[k]);
}

void AddToTarget(WheelSignals &s, const Numbers &v, double *)
{
    for (int k = 0; k < s.robot.wheels; ++k)
        Add<WheelSignals>(kWheelNames, s, k, *v.formula, s.target_mps[k]);
}

template <double GroundSignals::*velocity>
void AddToBody(GroundSignals &s, const Numbers &v, double *)
{
    Add<GroundSignals>(kBodyNames, s, 0, *v.formula, s.*velocity);
}

template <class S, size_t n>
std::vector<const char *> NamesOf(const Name<S> (&table)[n])
{
    std::vector<const char *> names;
    for (const Name<S> &name : table)
        names.push_back(name.name);
    return names;
}

// A quantity that a formula may add to, and what the formula may name.
struct Quantity
{
    const char *name;
    Act act;
    std::vector<const char *> names;
};

const Quantity &FindQuantity(const std::string &name)
{
    static const Quantity kQuantities[] = {
        {"duty", OnDuty{AddToDuty}, NamesOf(kDutyNames)},
        {"rim_mps", OnWheels{AddToTarget}, NamesOf(kWheelNames)},
        {"vx_mps", OnGround{AddToBody<&GroundSignals::vx_mps>}, NamesOf(kBodyNames)},
        {"vy_mps", OnGround{AddToBody<&GroundSignals::vy_mps>}, NamesOf(kBodyNames)},
        {"omega_radps", OnGround{AddToBody<&GroundSignals::omega_radps>}, NamesOf(kBodyNames)},
    };
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

EffectSpec::Compiled Compile(std::span<const double> values, std::span<const std::string> texts)
{
    const Quantity &quantity = FindQuantity(texts[0]);
    return {quantity.act, std::make_shared<Formula>(quantity.names, values, texts[1])};
}

}  // namespace

Formula::Formula(std::span<const char *const> names, std::span<const double> parameters,
                 const std::string &text)
    : values_(names.size())
{
    for (size_t i = 0; i < parameters.size(); ++i)
        parser_.DefineConst(kParameters[i].name, parameters[i]);
    for (size_t i = 0; i < names.size(); ++i)
        parser_.DefineVar(names[i], &values_[i]);
    Parse(names, text);
}

void Formula::Parse(std::span<const char *const> names, const std::string &text)
{
    // The parser would take these for assignments and texts.
    for (size_t i = 0; i < text.size(); ++i)
    {
        const bool compares = (i > 0 && std::string("=<>!").find(text[i - 1]) < 4) ||
                              (i + 1 < text.size() && text[i + 1] == '=');
        if (text[i] == '"' || text[i] == '\n' || (text[i] == '=' && !compares))
            Fail(text, static_cast<int>(i), "only numbers are computed here, not this sign");
    }
    try
    {
        parser_.SetExpr(text);
        int results = 0;
        parser_.Eval(results);
        if (results != 1)
            Fail(text, -1, "it must be one value, not a list of them");
        const mu::varmap_type in_text = parser_.GetUsedVar();
        for (size_t i = 0; i < names.size(); ++i)
            if (in_text.contains(names[i]))
                used_.push_back(i);
    }
    catch (const mu::ParserError &error)
    {
        Fail(parser_, error, text);
    }
}

EFFECT(equation) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{AddToBody<&GroundSignals::vx_mps>},
    .texts = kTexts,
    .compile = Compile,
};

}  // namespace twin

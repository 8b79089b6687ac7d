// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <set>
#include <stdexcept>

#include <muParser.h>

#include "effects/effect.h"
#include "effects/nearest.h"
#include "effects/own_numbers.h"
#include "effects/remember.h"

namespace twin
{

// A number of a formula, which it names.
struct NamedNumber
{
    std::string name;
    double value;
};

// A parsed formula, the rates of its states if it has any, and the places where all look for the
// values of their names. Evaluating writes them: one thread at a time, as for the states.
class Formula
{
public:
    // `rates`: of the states `s` and `r`, as many as there are. `values`: that the text has, 1
    // or 2.
    Formula(std::span<const char *const> names, std::span<const NamedNumber> numbers,
            const std::string &text, std::span<const std::string> rates, int values);

    // Places in the list of names that the texts use.
    std::span<const size_t> used() const { return used_; }
    double &operator[](size_t name) { return values_[name]; }
    // States of each wheel, or of the body.
    size_t states() const { return rates_.size(); }
    // Takes the states of wheel k, or of axis k of the room, through a step, first all `s` and then
    // all `r`; the formula then has their means over the step.
    void Remember(double *states, int k, double dt_s);
    // Its value; where it is not finite, nothing.
    double Evaluate() { return Finite(formula_.Eval()); }
    // Of a text with two values the one of axis k.
    double EvaluateAlong(int k) { return Finite(Along(formula_, k)); }
    // It was asked, and no value was finite.
    bool is_silent() const { return asked_ && !spoke_; }

private:
    double Finite(double value);
    static double Along(const mu::Parser &parser, int k);
    void Define(mu::Parser &parser, std::span<const char *const> names,
                std::span<const NamedNumber> numbers);
    // `one`: a single value is enough, however many the formula has.
    void Parse(mu::Parser &parser, std::span<const char *const> names, const std::string &key,
               const std::string &text, bool one, int values);

    std::vector<double> values_;
    std::vector<size_t> used_;
    TwoStates states_{};
    mu::Parser formula_;
    std::vector<mu::Parser> rates_;
    bool asked_ = false, spoke_ = false;
};

namespace
{

constexpr Card kCard = {
    .name = "equation",
    .drives = kAnyDrive,
    .summary = "A formula of one's own is added to a quantity of the drive.",
    .equation =
        "adds_to' = adds_to + formula(p0, p1, p2, p3, ..., s, r), ds/dt = state_rate, "
        "dr/dt = second_rate, s = r = 0 at the start. Per wheel, duty: u (duty or command), "
        "V (battery), left and front (1 or -1), t (s); rim_mps, speed the wheel tends to: these, "
        "target and rim (m/s, now), angle (rad). Body: vx, vy (m/s), omega (rad/s), x, y (m), "
        "theta and course, the direction in which it drives (rad), moves (0 or 1), t (s); travel and "
        "motion: the share of way that is more; room_mps: two values, along x, along y, each with states of its own, whose rates may have two values, too. Heading as captured, theta_rad: x, y, theta. Functions: abs sign min max sqrt exp ln sin "
        "cos tan asin acos atan atan2 sinh cosh tanh and more of muParser; a ? b : c; _pi",
    .leaves_out =
        "more than two states; where the formula has no finite value, nothing is added, and where "
        "a rate has none, s and r stay; one that grows beyond all bounds stays at 1e12",
    .measure = "whatever drive varies the quantities in the formula; what it resembles is its own",
    .reference = "muParser (the parser); the formula is the user's",
    .family = Family::kFormula,
    .needs = Needs::kSteadySpeed,
    .phrase = "a formula of its own",
};

// Of any number of a formula, in the formula's unit: a slow robot's heat has hundreds of s^2/m^2.
constexpr double kFar = 1e6;

constexpr ParameterSpec kParameters[] = {
    {"p0", "1", 0, 0.01, -kFar, kFar, "p0 of the formula, in the unit that it gives it"},
    {"p1", "1", 0, 0.01, -kFar, kFar, "p1 of the formula"},
    {"p2", "1", 0, 0.01, -kFar, kFar, "p2 of the formula"},
    {"p3", "1", 0, 0.01, -kFar, kFar, "p3 of the formula"},
};

constexpr TextParameter kTexts[] = {
    {"adds_to", "vx_mps",
     "one of duty, rim_mps (per wheel), vx_mps, vy_mps, omega_radps (body), travel (share of vx "
     "and vy), motion (share of vx, vy, omega), aside (share of the way led to its left), "
     "room_mps (push along x and along y of the room: two values with a comma between), "
     "theta_rad (captured heading)"},
    {"formula", "p0*vx + p1*vy + p2*omega + p3*vx*abs(vx)",
     "what is added, in the unit of adds_to; should be 0 where p0 to p3 are"},
    {"state_rate", "",
     "ds/dt, of the same names and s; then the formula may name s, at rim_mps of each wheel"},
    {"second_rate", "",
     "dr/dt of a second state r, where both rates may name s and r: what swings, with state_rate r"},
    {"called", "", "name of the effect, as air; its numbers are then equation#air.p0 and so on"},
    {"numbers", "",
     "names and units of the formula's numbers in the place of p0 to p3, as in 'drag s/m, ratio'"},
};
constexpr size_t kCalled = 4, kNumbers = 5;  // places of these texts

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
    {"course",
     [](const GroundSignals &s, int) { return s.theta_rad + std::atan2(s.vy_mps, s.vx_mps); }},
    {"moves", [](const GroundSignals &s, int) { return s.moves ? 1.0 : 0.0; }},
};

constexpr Name<ObservedPose> kPoseNames[] = {
    {"x", [](const ObservedPose &p, int) { return p.x_m; }},
    {"y", [](const ObservedPose &p, int) { return p.y_m; }},
    {"theta", [](const ObservedPose &p, int) { return p.theta_rad; }},
};

// Gives the formula what it names of wheel k, and its states the end of their step.
template <class S>
void Tell(std::span<const Name<S>> names, const S &s, int k, Formula &formula, double *state)
{
    for (const size_t i : formula.used())
        formula[i] = names[i].value(s, k);
    if (formula.states() > 0)
        formula.Remember(state, k, s.dt_s);
}

// The formula's value for wheel k.
template <class S>
double Value(std::span<const Name<S>> names, const S &s, int k, Formula &formula, double *state)
{
    Tell(names, s, k, formula, state);
    return formula.Evaluate();
}

void AddToDuty(DutySignals &s, const Numbers &v, double *state)
{
    for (int k = 0; k < kMaxWheels; ++k)  // a velocity command has three parts on any robot
        s.duty[k] += Value<DutySignals>(kDutyNames, s, k, *v.formula, state);
}

void AddToTarget(WheelSignals &s, const Numbers &v, double *state)
{
    for (int k = 0; k < s.robot.wheels; ++k)
        s.target_mps[k] += Value<WheelSignals>(kWheelNames, s, k, *v.formula, state);
}

template <double GroundSignals::*velocity>
void AddToBody(GroundSignals &s, const Numbers &v, double *state)
{
    s.*velocity += Value<GroundSignals>(kBodyNames, s, 0, *v.formula, state);
}

template <bool turning>
void AddShare(GroundSignals &s, const Numbers &v, double *state)
{
    const double share = 1 + Value<GroundSignals>(kBodyNames, s, 0, *v.formula, state);
    s.vx_mps *= share;
    s.vy_mps *= share;
    s.omega_radps *= turning ? share : 1;
}

void LeadAside(GroundSignals &s, const Numbers &v, double *state)
{
    const double share = Value<GroundSignals>(kBodyNames, s, 0, *v.formula, state);
    const double vx_mps = s.vx_mps;
    s.vx_mps -= share * s.vy_mps;
    s.vy_mps += share * vx_mps;
}

void PushInRoom(GroundSignals &s, const Numbers &v, double *state)
{
    std::array<double, 2> push_mps{};
    for (int axis = 0; axis < 2; ++axis)
    {
        Tell<GroundSignals>(kBodyNames, s, axis, *v.formula, state);
        push_mps[axis] = v.formula->EvaluateAlong(axis);
    }
    const auto [x_mps, y_mps] = push_mps;
    const double ahead = std::cos(s.theta_rad), left = std::sin(s.theta_rad);
    s.vx_mps += ahead * x_mps + left * y_mps;
    s.vy_mps += ahead * y_mps - left * x_mps;
}

double HeadingError(const ObservedPose &p, Formula &formula)
{
    for (const size_t i : formula.used())
        formula[i] = kPoseNames[i].value(p, 0);
    return formula.Evaluate();
}

void AddToHeading(ObservedPose &p, const Numbers &v)
{
    p.theta_rad += HeadingError(p, *v.formula);
}

// By repeated substitution: an error grows by less than the heading itself.
void TakeFromHeading(ObservedPose &p, const Numbers &v)
{
    constexpr int kRounds = 50;
    constexpr double kClose_rad = 1e-12;
    const double seen_rad = p.theta_rad;
    for (int round = 0; round < kRounds; ++round)
    {
        const double before_rad = p.theta_rad;
        p.theta_rad = seen_rad - HeadingError(p, *v.formula);
        if (std::abs(p.theta_rad - before_rad) < kClose_rad)
            return;
    }
}

int StateSize(const Numbers &v)
{
    return v.formula ? kMaxWheels * static_cast<int>(v.formula->states()) : 0;
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
    int values = 1;  // of the formula
};

const Quantity &FindQuantity(const std::string &name)
{
    static const Quantity kQuantities[] = {
        {"duty", OnDuty{AddToDuty}, NamesOf(kDutyNames)},
        {"rim_mps", OnWheels{AddToTarget}, NamesOf(kWheelNames)},
        {"vx_mps", OnGround{AddToBody<&GroundSignals::vx_mps>}, NamesOf(kBodyNames)},
        {"vy_mps", OnGround{AddToBody<&GroundSignals::vy_mps>}, NamesOf(kBodyNames)},
        {"omega_radps", OnGround{AddToBody<&GroundSignals::omega_radps>}, NamesOf(kBodyNames)},
        {"travel", OnGround{AddShare<false>}, NamesOf(kBodyNames)},
        {"motion", OnGround{AddShare<true>}, NamesOf(kBodyNames)},
        {"aside", OnGround{LeadAside}, NamesOf(kBodyNames)},
        {"room_mps", OnGround{PushInRoom}, NamesOf(kBodyNames), 2},
        {"theta_rad", OnObservation{AddToHeading, TakeFromHeading}, NamesOf(kPoseNames)},
    };
    std::set<std::string> known;
    for (const Quantity &quantity : kQuantities)
    {
        if (name == quantity.name)
            return quantity;
        known.insert(quantity.name);
    }
    throw std::invalid_argument("equation.adds_to = " + Quoted(name) + " is unknown; " +
                                NearestKnown(name, known));
}

// The parser's complaint as one sentence, positions counted from 1.
[[noreturn]] void Fail(const std::string &key, const std::string &text, int position,
                       const std::string &what)
{
    const int end = static_cast<int>(text.size());
    const std::string where =
        position < 0 ? "" : " at letter " + std::to_string(std::min(position, end) + 1);
    throw std::invalid_argument("equation." + key + " = " + Quoted(text) + ": " + what + where);
}

// The same for one that the parser found.
[[noreturn]] void Fail(const mu::Parser &parser, const mu::ParserError &error,
                       const std::string &key, const std::string &text)
{
    const std::string &token = error.GetToken();
    if (error.GetCode() != mu::ecUNASSIGNABLE_TOKEN || !(std::isalpha(token[0]) || token[0] == '_'))
    {
        std::string what = error.GetMsg().substr(0, error.GetMsg().find(" at position"));
        what = what.substr(0, what.find_last_not_of(".!") + 1);
        Fail(key, text, error.GetPos(), what);
    }
    if (token == "s" || token == "r")
        Fail(key, text, error.GetPos(),
             "the state '" + token + "' has no rate of change; give " +
                 (token == "s" ? "state_rate (--state-rate), its ds/dt,"
                               : "second_rate (--second-rate), its dr/dt,"));
    std::set<std::string> known;
    for (const auto &[name, address] : parser.GetVar())
        known.insert(name);
    for (const auto &[name, value] : parser.GetConst())
        known.insert(name);
    for (const auto &[name, function] : parser.GetFunDef())
        known.insert(name);
    Fail(key, text, error.GetPos(),
         "unknown name " + Quoted(token) + ", " + NearestKnown(token, known) + ",");
}

// Raises where the author's name of a number means something else in the formula or in the file.
void CheckNumber(const std::string &name, const std::string &text, const Quantity &quantity)
{
    const auto is = [&](const char *other) { return name == other; };
    const bool in_formula = std::ranges::any_of(quantity.names, is) || name == "s" || name == "r" ||
                            mu::Parser().GetFunDef().contains(name);
    const bool in_file =
        std::ranges::any_of(kEffectKeys, is) ||
        std::ranges::any_of(kTexts, is, [](const TextParameter &own) { return own.name; });
    if (in_formula || in_file)
        Fail("numbers", text, -1,
             "'" + name + "' means something else in a " + (in_formula ? "formula" : "model file") +
                 "; take another name");
}

// The formula's numbers: as its author calls them, else p0 to p3.
std::vector<NamedNumber> Named(std::span<const double> values, const std::string &text,
                               const Quantity &quantity)
{
    std::vector<NamedNumber> numbers;
    for (const OwnNumber &own : OwnNumbers(text, std::size(kParameters)))
    {
        CheckNumber(own.name, text, quantity);
        numbers.push_back({own.name, 0});
    }
    if (numbers.empty())
        for (const ParameterSpec &usual : kParameters)
            numbers.push_back({usual.name, 0});
    for (size_t i = 0; i < std::min(numbers.size(), values.size()); ++i)
        numbers[i].value = values[i];
    return numbers;
}

EffectSpec::Compiled Compile(std::span<const double> values, std::span<const std::string> texts)
{
    const Quantity &quantity = FindQuantity(texts[0]);
    const std::string &rate = texts[2], &second = texts[3];
    if (rate.empty() && !second.empty())
        Fail("second_rate", second, -1, "there is no first state; give state_rate, such as r, too");
    const bool duty = std::holds_alternative<OnDuty>(quantity.act);
    if (!rate.empty() && (duty || std::holds_alternative<OnObservation>(quantity.act)))
        Fail("state_rate", rate, -1,
             "what is added to " + texts[0] + " has no state; leave it empty, or add to " +
                 (duty ? "rim_mps" : "omega_radps"));
    const std::string &called = texts[kCalled];
    if (!called.empty() && !IsPlainName(called))
        Fail("called", called, -1,
             "this is no name; write one with letters, figures and underscores");
    const auto rates = texts.subspan(2, rate.empty() ? 0 : second.empty() ? 1 : 2);
    const std::vector<NamedNumber> numbers = Named(values, texts[kNumbers], quantity);
    return {quantity.act,
            std::make_shared<Formula>(quantity.names, numbers, texts[1], rates, quantity.values)};
}

}  // namespace

Formula::Formula(std::span<const char *const> names, std::span<const NamedNumber> numbers,
                 const std::string &text, std::span<const std::string> rates, int values)
    : values_(names.size()), rates_(rates.size())
{
    Define(formula_, names, numbers);
    Parse(formula_, names, "formula", text, values == 1, values);
    for (size_t i = 0; i < rates.size(); ++i)
    {
        Define(rates_[i], names, numbers);
        Parse(rates_[i], names, kTexts[2 + i].name, rates[i], true, values);
    }
}

double Formula::Finite(double value)
{
    const bool finite = std::isfinite(value);
    asked_ = true;
    spoke_ = spoke_ || finite;
    return finite ? value : 0;
}

double Formula::Along(const mu::Parser &parser, int k)
{
    int count = 0;
    const double *values = parser.Eval(count);
    return values[count > 1 ? k : 0];
}

void Formula::Define(mu::Parser &parser, std::span<const char *const> names,
                     std::span<const NamedNumber> numbers)
{
    for (const NamedNumber &number : numbers)
        parser.DefineConst(number.name, number.value);
    for (size_t i = 0; i < names.size(); ++i)
        parser.DefineVar(names[i], &values_[i]);
    constexpr const char *kStates[] = {"s", "r"};
    for (size_t i = 0; i < states(); ++i)
        parser.DefineVar(kStates[i], &states_[i]);
}

void Formula::Parse(mu::Parser &parser, std::span<const char *const> names, const std::string &key,
                    const std::string &text, bool one, int values)
{
    // The parser would take these for assignments and texts.
    for (size_t i = 0; i < text.size(); ++i)
    {
        const bool compares = (i > 0 && std::string("=<>!").find(text[i - 1]) < 4) ||
                              (i + 1 < text.size() && text[i + 1] == '=');
        if (text[i] == '"' || text[i] == '\n' || (text[i] == '=' && !compares))
            Fail(key, text, static_cast<int>(i), "only numbers are computed here, not this sign");
    }
    try
    {
        parser.SetExpr(text);
        int results = 0;
        parser.Eval(results);
        if (results != values && !(one && results == 1))
            Fail(key, text, -1,
                 values == 1 ? "it must be one value, not a list of them"
                             : "it must be two values, along x and along y, with a comma between");
        const mu::varmap_type in_text = parser.GetUsedVar();
        for (size_t i = 0; i < names.size(); ++i)
            if (in_text.contains(names[i]) && std::ranges::find(used_, i) == used_.end())
                used_.push_back(i);
    }
    catch (const mu::ParserError &error)
    {
        Fail(parser, error, key, text);
    }
}

void Formula::Remember(double *states, int k, double dt_s)
{
    double &own = states[k];
    if (rates_.size() == 1)
    {
        states_[0] = twin::Remember(own, dt_s, [this, k](double at) {
            states_[0] = at;
            return Along(rates_[0], k);
        });
        return;
    }
    double &second = states[kMaxWheels + k];
    TwoStates both{own, second};
    states_ = twin::Remember(both, dt_s, [this, k](const TwoStates &at) {
        states_ = at;
        return TwoStates{Along(rates_[0], k), Along(rates_[1], k)};
    });
    own = both[0];
    second = both[1];
}

bool IsSilent(const Formula &formula)
{
    return formula.is_silent();
}

EFFECT(equation) = {
    .card = kCard,
    .parameters = kParameters,
    .act = OnGround{AddToBody<&GroundSignals::vx_mps>},
    .state_size = StateSize,
    .texts = kTexts,
    .compile = Compile,
};

}  // namespace twin

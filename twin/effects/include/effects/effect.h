// SPDX-License-Identifier: Apache-2.0
// A physical effect is data: a card, a table of parameters, and what it does to the signals of its
// stage. catalogue/ holds one file per effect; the list of all is generated from its folder.
//
// One step of one robot passes its signals through the stages in the order of `Act`; within a stage
// the effects act by their turn, those of one turn in the order of the model file. What an effect
// remembers of one robot lies in `state`, plain doubles owned by the plant, so that a robot can be
// copied and restarted.
#ifndef EFFECTS_EFFECT_H
#define EFFECTS_EFFECT_H

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "effects/card.h"
#include "effects/parameter.h"
#include "effects/signals.h"

namespace twin
{

struct EachGround;  // in effects/together.h

// A compiled formula, of those effects that have one.
class Formula;
// It was asked at steps, and had a finite value at none.
bool IsSilent(const Formula &formula);

// The numbers of one effect in one model, in the order of its parameters; per-wheel parameters
// wheel by wheel.
struct Numbers
{
    std::span<const double> values;
    Formula *formula = nullptr;

    double operator[](int i) const { return values[static_cast<size_t>(i)]; }
};

// What an effect does, by stage. `state` holds state_size() doubles, zero at the start.
struct OnDuty
{
    void (*step)(DutySignals &, const Numbers &, double *state);
};
struct OnWheels
{
    void (*step)(WheelSignals &, const Numbers &, double *state);
};
struct OnRolling
{
    void (*step)(RollSignals &, const Numbers &, double *state);
};
struct OnGround
{
    void (*step)(GroundSignals &, const Numbers &, double *state);
    // The same of several robots, where that is quicker than one after the other: of an effect
    // without state alone.
    void (*steps)(EachGround &, const Numbers &) = nullptr;
};
struct OnBody
{
    void (*set)(Body &, const Numbers &);
};
struct OnObservation
{
    void (*observe)(ObservedPose &, const Numbers &);
    // From the pose seen and its time stamp back to the robot's own.
    void (*invert)(ObservedPose &, const Numbers &);
};
struct OnView
{
    void (*set)(DetectionModel &, const Numbers &);
};
struct OnDecision
{
    void (*set)(DetectionModel &, const Numbers &);
};
using Act =
    std::variant<OnDuty, OnWheels, OnRolling, OnGround, OnBody, OnObservation, OnView, OnDecision>;

// The stage's name in the catalogue; rolling is part of "wheel".
const char *StageName(const Act &act);

// A choice or formula of an effect: what no number can say.
struct TextParameter
{
    const char *name;
    const char *default_value;
    const char *doc;
};

// When an effect acts within its stage.
enum class Turn
{
    kFirst,
    kUsual,
    kLast,
};

struct EffectSpec
{
    // An effect with texts: where it acts with these, and its formula.
    struct Compiled
    {
        Act act;
        std::shared_ptr<Formula> formula;
    };

    Card card;
    std::span<const ParameterSpec> parameters;
    Act act;
    int (*state_size)(const Numbers &) = nullptr;  // doubles that it remembers; nullptr: none
    Turn turn = Turn::kUsual;   // within its stage, wherever the model file has it
    bool needs_wheels = false;  // of robots whose wheels are known
    std::span<const TextParameter> texts = {};
    // Of `values` and `texts` in their order. Throws std::invalid_argument in one sentence if a
    // text makes no sense.
    Compiled (*compile)(std::span<const double> values,
                        std::span<const std::string> texts) = nullptr;
};

// Share of what begins at a moment that is there `since_s` after it: 1 / (1 + exp(-t / edge)).
double Begun(double since_s, double edge_s);

// What begins at once has this edge: narrower than the shortest prediction, so that the moment can
// be fitted and is one.
inline constexpr double kAtOnce_s = 0.1;
inline constexpr double kSlowest_s = 5;  // 22 s from 0.1 to 0.9; slower is heat or a battery

// Defines the effect of the file catalogue/<name>.cpp.
#define EFFECT(name)                        \
    extern const EffectSpec kEffect_##name; \
    const EffectSpec kEffect_##name

// An effect with its numbers, ready to act.
class BoundEffect
{
public:
    // Throws std::invalid_argument in one sentence if a text makes no sense.
    BoundEffect(const EffectSpec &spec, std::vector<double> values,
                std::span<const std::string> texts = {});

    const EffectSpec &spec() const { return *spec_; }
    const Act &act() const { return act_; }
    Numbers numbers() const { return {values_, formula_.get()}; }
    int StateSize() const { return spec_->state_size ? spec_->state_size(numbers()) : 0; }
    bool IsSilent() const { return formula_ && twin::IsSilent(*formula_); }
    // The same effect with the same numbers and texts.
    bool operator==(const BoundEffect &other) const
    {
        return spec_ == other.spec_ && values_ == other.values_ && texts_ == other.texts_;
    }
    // What it does to a camera or a body; nothing if it acts elsewhere.
    void Set(DetectionModel &detection) const;
    void Set(Body &body) const;

private:
    const EffectSpec *spec_;
    std::vector<double> values_;
    std::vector<std::string> texts_;
    std::shared_ptr<Formula> formula_;
    Act act_;
};

// All effects in alphabetical order.
std::span<const EffectSpec *const> Catalogue();
// The effect of that name, or nullptr.
const EffectSpec *FindEffect(std::string_view name);

}  // namespace twin

#endif

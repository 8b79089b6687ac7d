// SPDX-License-Identifier: Apache-2.0
#include "model_file/wheels.h"

#include <cmath>
#include <numbers>

#include "model_file/model.h"

namespace twin
{
namespace
{

std::vector<Wheel> FourAt(double x_m, double y_m, Tread front_left, Tread front_right)
{
    return {{"fl", "front left wheel", x_m, y_m, 1, 0, front_left},
            {"fr", "front right wheel", x_m, -y_m, 1, 0, front_right},
            {"rl", "rear left wheel", -x_m, y_m, 1, 0, front_right},
            {"rr", "rear right wheel", -x_m, -y_m, 1, 0, front_left}};
}

std::vector<Wheel> TwoAt(double y_m)
{
    return {{"fl", "left wheel", 0, y_m, 1, 0, Tread::kPlain},
            {"fr", "right wheel", 0, -y_m, 1, 0, Tread::kPlain}};
}

std::vector<Wheel> ThreeAround(double lever_m)
{
    static constexpr const char *kNames[] = {"w1", "w2", "w3"};
    static constexpr const char *kWords[] = {"first wheel", "second wheel", "third wheel"};
    std::vector<Wheel> wheels;
    for (int k = 0; k < 3; ++k)
    {
        const double at_rad = std::numbers::pi * (1 + 2 * k) / 3;
        const double c = std::cos(at_rad), s = std::sin(at_rad);
        wheels.push_back(
            {kNames[k], kWords[k], lever_m * c, lever_m * s, -s, c, Tread::kRollersAcross});
    }
    return wheels;
}

std::string Filled(std::string text, const Wheel &wheel)
{
    for (const auto &[mark, word] : {std::pair{"{wheel}", wheel.name}, {"{words}", wheel.words}})
        for (size_t at; (at = text.find(mark)) != std::string::npos;)
            text.replace(at, std::string(mark).size(), word);
    return text;
}

Parameter Made(const ParameterSpec &spec, const Wheel &wheel)
{
    Parameter p;
    p.name = Filled(spec.name, wheel);
    p.unit = spec.unit;
    p.value = p.neutral = spec.neutral;
    p.min = spec.min;
    p.max = spec.max;
    p.default_value = spec.default_value;
    p.usual_size = UsualSize(spec);
    p.role = spec.role;
    p.above = Filled(spec.above, wheel);
    p.below = Filled(spec.below, wheel);
    p.doc = Filled(spec.doc, wheel);
    return p;
}

}  // namespace

bool IsPerWheel(const ParameterSpec &spec)
{
    return std::string(spec.name).find("{wheel}") != std::string::npos;
}

double Wheel::grip_x() const
{
    switch (tread)
    {
        case Tread::kRollersLeft: return roll_x - roll_y;
        case Tread::kRollersRight: return roll_x + roll_y;
        case Tread::kPlain:
        case Tread::kRollersAcross: break;
    }
    return roll_x;
}

double Wheel::grip_y() const
{
    switch (tread)
    {
        case Tread::kRollersLeft: return roll_y + roll_x;
        case Tread::kRollersRight: return roll_y - roll_x;
        case Tread::kPlain:
        case Tread::kRollersAcross: break;
    }
    return roll_y;
}

std::vector<Wheel> DrivenWheels(const Robot &robot, WheelKind kind)
{
    const double x_m = robot.half_wheelbase_m, y_m = robot.half_track_m;
    switch (kind)
    {
        case WheelKind::kDifferential:
            return x_m > 0 ? FourAt(x_m, y_m, Tread::kPlain, Tread::kPlain) : TwoAt(y_m);
        case WheelKind::kOmni3: return ThreeAround(robot.half_track_m);
        case WheelKind::kAckermann:
            return {{"rl", "rear left wheel", -x_m, y_m, 1, 0, Tread::kPlain},
                    {"rr", "rear right wheel", -x_m, -y_m, 1, 0, Tread::kPlain}};
        case WheelKind::kMecanum:
        case WheelKind::kNone: break;
    }
    return FourAt(x_m, y_m, Tread::kRollersRight, Tread::kRollersLeft);
}

const char *WheelKindName(WheelKind kind)
{
    switch (kind)
    {
        case WheelKind::kMecanum: return "mecanum";
        case WheelKind::kDifferential: return "differential";
        case WheelKind::kOmni3: return "omni3";
        case WheelKind::kAckermann: return "ackermann";
        case WheelKind::kNone: return "none";
    }
    return "";
}

std::vector<Parameter> ParametersFor(const EffectSpec &spec, const std::vector<Wheel> &wheels)
{
    std::vector<Parameter> parameters;
    for (size_t i = 0; i < spec.parameters.size();)
    {
        size_t end = i + 1;
        if (!IsPerWheel(spec.parameters[i]))
        {
            parameters.push_back(Made(spec.parameters[i], {}));
            i = end;
            continue;
        }
        while (end < spec.parameters.size() && IsPerWheel(spec.parameters[end]))
            ++end;
        for (const Wheel &wheel : wheels)
            for (size_t k = i; k < end; ++k)
                parameters.push_back(Made(spec.parameters[k], wheel));
        i = end;
    }
    return parameters;
}

}  // namespace twin

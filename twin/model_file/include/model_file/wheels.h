// SPDX-License-Identifier: Apache-2.0
// The wheels of a robot: how many, where, and how they roll and grip.
#ifndef MODEL_FILE_WHEELS_H
#define MODEL_FILE_WHEELS_H

#include <string>
#include <vector>

#include "effects/effect.h"

namespace twin
{

struct Robot;

enum class WheelKind
{
    kMecanum,       // four, rollers at 45 degrees
    kDifferential,  // plain wheels left and right, in pairs
    kOmni3,         // three at 60, 180 and 300 degrees, rollers across, forward positive
    kAckermann,     // the rear pair drives, the front pair steers
    kNone           // the ideal mecanum equations
};

// What touches the floor.
enum class Tread
{
    kPlain,          // grips in all directions
    kRollersLeft,    // rollers whose axis at the floor points forward and left, (1, 1)
    kRollersRight,   // (1, -1)
    kRollersAcross,  // grips only in the direction in which the wheel rolls
};

// A driven wheel, in the body frame.
struct Wheel
{
    const char *name, *words;  // "fl", "front left wheel"
    double x_m, y_m;
    double roll_x, roll_y;  // unit vector: where it rolls at positive speed
    Tread tread;

    // The direction in which it grips while it rolls freely across, scaled so that its part along
    // the rolling direction is 1.
    double grip_x() const;
    double grip_y() const;
};

// At most kMaxWheels.
std::vector<Wheel> DrivenWheels(const Robot &robot, WheelKind kind);

const char *WheelKindName(WheelKind kind);

// One parameter for each driven wheel.
bool IsPerWheel(const ParameterSpec &spec);

// The parameters of an effect for a robot with these wheels, at their neutral values.
std::vector<Parameter> ParametersFor(const EffectSpec &spec, const std::vector<Wheel> &wheels);

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// A number of a model that a fit may change: what the tables say of it, and what a model has.
#ifndef EFFECTS_PARAMETER_H
#define EFFECTS_PARAMETER_H

#include <string>

namespace twin
{

// What a parameter says, for those who search for its value.
enum class Role
{
    kSize,      // how strong the effect is
    kPlace,     // where in the room it acts, how far: a search starts from several places
    kMoment,    // when it begins: a search starts from several
    kDuration,  // how long it takes to come: no fit moves it unless told to
    kLateness,  // how late a response comes: only the sum with other such parameters is firm
    kLimit,     // beyond which something happens, with no trace below: a search starts from several
    kRadius,    // of a wheel, by which its angle grows: the errors of a log tell where to start
};

// A row of an effect's table, the only place of the parameter's name, unit and bounds. A name that
// holds "{wheel}" stands for one parameter per driven wheel: "{wheel}" becomes the wheel's name and
// "{words}" its name in words; rows that follow each other alternate wheel by wheel.
struct ParameterSpec
{
    const char *name;
    const char *unit;      // "1" for a pure number
    double neutral;        // value at which the effect does nothing, bit for bit
    double default_value;  // plausible value: where a fit starts
    double min, max;
    const char *doc;
    // Of a robot whose value is above or below neutral, in plain words; empty: none fit.
    const char *above = "", *below = "";
    double usual_size = 0;  // standard deviation over robots; 0: twice from neutral to default
    Role role = Role::kSize;
};

// `usual_size`, or what its 0 stands for.
double UsualSize(const ParameterSpec &spec);

const char *RoleName(Role role);

// A number of one model.
struct Parameter
{
    std::string name, unit;
    double value = 0, min = 0, max = 0;
    double neutral = 0, default_value = 0;
    double usual_size = 0;  // how far robots are usually from neutral: a fit's weak prior
    bool held = false;      // no fit moves it unless told to
    Role role = Role::kSize;
    const char *stage = "";  // of the effect, or at which a number of the base acts; "": at none
    std::string above = {}, below = {}, doc = {};

    // Throws std::invalid_argument in one sentence, which begins with `what`, if `value` is out of
    // bounds.
    void CheckBounds(double value, const std::string &what) const;
};

}  // namespace twin

#endif

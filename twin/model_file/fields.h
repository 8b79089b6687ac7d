// SPDX-License-Identifier: Apache-2.0
// The one table of the plain numbers of a model file: section, key, unit, bounds, place in Model.
#ifndef MODEL_FILE_FIELDS_H
#define MODEL_FILE_FIELDS_H

#include <span>

#include "model_file/model.h"

namespace twin
{

struct Field
{
    const char *section, *key, *unit;
    double min, max;
    double &(*at)(Model &);
    bool per_robot;          // may stand in [robots.Rnn]
    double usual_size = 0;   // how far robots are usually from the default; 0: no fit moves it
    const char *stage = "";  // at which it acts in a prediction; "": at none, or at all

    bool Is(std::string_view name) const;
    std::string Name() const { return *section ? std::string(section) + "." + key : key; }
    // The number as `model` has it.
    Parameter In(const Model &model) const;
};

std::span<const Field> Fields();

}  // namespace twin

#endif

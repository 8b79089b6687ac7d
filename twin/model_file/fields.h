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
    bool per_robot;  // may stand in [robots.Rnn]
};

std::span<const Field> Fields();

}  // namespace twin

#endif

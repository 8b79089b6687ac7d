// SPDX-License-Identifier: Apache-2.0
// Models as plain Python values, and back: for pickle.
#ifndef PYTHON_PICKLE_BINDINGS_H
#define PYTHON_PICKLE_BINDINGS_H

#include <nanobind/nanobind.h>

#include "model_file/model.h"

namespace twin
{

namespace nb = nanobind;

// All that a model holds.
nb::tuple StateOf(const Model &model);
Model ModelOf(const nb::tuple &state);

}  // namespace twin

#endif

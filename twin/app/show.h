// SPDX-License-Identifier: Apache-2.0
// What to show of a run, from its options.
#ifndef APP_SHOW_H
#define APP_SHOW_H

#include <vector>

#include "options.h"
#include "view/views.h"

namespace twin
{

ViewOptions MakeViewOptions(const Options &options, const std::vector<Model> &robots);

}  // namespace twin

#endif

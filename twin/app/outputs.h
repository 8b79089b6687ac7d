// SPDX-License-Identifier: Apache-2.0
// What a run writes over: nothing that it reads, and nothing else unless it was told to.
#ifndef APP_OUTPUTS_H
#define APP_OUTPUTS_H

#include "options.h"

namespace twin
{

// Before the long work. Throws std::runtime_error in one sentence if a file of the command line
// cannot stand where it shall.
void CheckOutputs(const Options &options);

}  // namespace twin

#endif

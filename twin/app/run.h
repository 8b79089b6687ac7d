// SPDX-License-Identifier: Apache-2.0
// One run of a simulated swarm, from its options to its summary.
#ifndef APP_RUN_H
#define APP_RUN_H

#include "options.h"

namespace twin
{

// Asks the run in progress to end as if its time were over. Safe in a signal handler.
void RequestStop();

// Throws std::exception with one sentence; then no log is left behind.
void Run(const Options &options);

}  // namespace twin

#endif

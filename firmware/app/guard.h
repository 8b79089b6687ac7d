// SPDX-License-Identifier: Apache-2.0
// A second process that stops the wheels, for when the first, the supervisor, cannot.
#ifndef APP_GUARD_H
#define APP_GUARD_H

#include <sys/types.h>

#include "options.h"
#include "watch.h"

// Runs in a child of the supervisor, with another name and session, deaf to all signals that a
// process can be deaf to. Acts a little later than the supervisor would; ends when that has ended
// and the wheels stand.
_Noreturn void guard_run(const struct options *options, struct watch *watch, pid_t supervisor);

#endif

// SPDX-License-Identifier: Apache-2.0
// A parent that outlives the process it started to drive, and stops the wheels when that dies or
// hangs. A second one, the guard, does so when the parent cannot.
#ifndef APP_SUPERVISOR_H
#define APP_SUPERVISOR_H

#include "options.h"
#include "watch.h"

// The program itself: beats in watch. @param stop_fd readable when a signal asks to end.
// @return its exit code.
typedef int driver_fn(const struct options *options, struct watch *watch, int stop_fd);

// Takes the signals that have come, but for SIGHUP of the driver's: the supervisor's alone counts.
// @return one that asks to end, or 0.
int supervisor_asked_to_end(int stop_fd);

// Exit code if another program has the motor board.
#define SUPERVISOR_EXIT_HELD 3
// Exit code if all went as asked, but rows of a log were lost.
#define SUPERVISOR_EXIT_LOG_LOST 4

// Starts the driver in a child process and again whenever it dies, until a signal asks to end or
// the driver ends by itself with code 0 or 2. SIGHUP ends a program that has a terminal; of another
// it stops the wheels, and what drives next has the configuration as it is then. Whatever ended it,
// the board is told zero, before anything else is done or said. A board that was to be found is
// written into the options. Signals that end or suspend programs stay blocked for the rest of the
// process.
// @return the exit code.
int supervise(struct options *options, driver_fn *drive);

#endif

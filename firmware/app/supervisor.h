// SPDX-License-Identifier: Apache-2.0
// A parent that outlives the program it started, and stops the wheels when that dies or hangs.
#ifndef APP_SUPERVISOR_H
#define APP_SUPERVISOR_H

#include <stdbool.h>

#include "options.h"

// How the worker says that it lives.
struct heartbeat
{
    int fd;
};

// Called after every control step. @param moving some wheel may turn.
void heartbeat_send(const struct heartbeat *heartbeat, bool moving);

// The program itself. @param stop_fd readable when a signal asks to end. @return its exit code.
typedef int worker_fn(const struct options *options, const struct heartbeat *heartbeat,
                      int stop_fd);

// Starts the worker in a child process and again whenever it dies, until a signal asks to end or
// the worker ends by itself with code 0 or 2. Whatever ended the worker, the board is told zero.
// A board that was to be found is written into the options. SIGTERM, SIGINT and SIGHUP stay blocked
// for the rest of the process. @return the exit code.
int supervise(struct options *options, worker_fn *worker);

// Tells the board zero until it takes it, for at most a second.
bool stop_board(const struct options *options);

#endif

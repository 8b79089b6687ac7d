// SPDX-License-Identifier: Apache-2.0
// Keeps in mind, for the next run of the program too, that the robot was stopped: by a file of one
// of two names, so that a stop only renames it. A disk that is full takes that.
#ifndef APP_LATCH_H
#define APP_LATCH_H

#include <stdbool.h>
#include <stdint.h>

#include "config.h"

struct latch
{
    // Folder of the file; empty: nothing is kept.
    const char *folder;
    // What the file says.
    bool is_stopped;
    // It could not be made to say so, and when that is tried again (monotonic).
    bool is_lost;
    int64_t retry_us;
};

// @param folder lives as long as the latch. @return whether the last run was stopped.
bool latch_open(struct latch *latch, const char *folder, int64_t now_us);

// A change is kept at once; what could not be kept is tried again once a second.
void latch_keep(struct latch *latch, bool is_stopped, int64_t now_us);

// A stop outlives the program.
bool latch_works(const struct latch *latch);

#endif

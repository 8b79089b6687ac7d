// SPDX-License-Identifier: Apache-2.0
// Stops the wheels from outside the process that drives them: opens the board itself, tells it
// zero, and asks it whether that holds.
#ifndef APP_STOPPER_H
#define APP_STOPPER_H

#include <stdbool.h>
#include <sys/types.h>

#include "config.h"
#include "devices.h"
#include "watch.h"

// One per process. All zero: nothing is open.
struct stopper
{
    const struct app_config *config;
    bool dry_run;
    bool is_made;
    // The board took the last stop, whether it has confirmed it or not.
    bool was_told;
    struct board_drivers drivers;
    struct loop_devices devices;
};

// Opens the board, if it is there: a stop then needs no file that could not be opened.
void stopper_hold(struct stopper *stopper);

// Tells the board zero once. @return true if it has confirmed it.
bool stopper_stop(struct stopper *stopper);

// Kills whoever drives and stops the wheels, once. What it was about to write may still come
// before it is gone, so only a stop after that counts. @return true if one was confirmed; watch
// then says so.
bool stopper_end_driver(struct stopper *stopper, struct watch *watch);

void stopper_close(struct stopper *stopper);

#endif

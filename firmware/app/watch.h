// SPDX-License-Identifier: Apache-2.0
// What the program's processes tell each other, in memory that they share: nothing in it can block,
// and nothing can fill up.
#ifndef APP_WATCH_H
#define APP_WATCH_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

enum watch_role
{
    WATCH_DRIVER,
    WATCH_SUPERVISOR,
    WATCH_GUARD,
    WATCH_ROLE_COUNT,
};

struct watch
{
    // When each said last that it lives (CLOCK_MONOTONIC).
    _Atomic int64_t beat_us[WATCH_ROLE_COUNT];
    // The process that may write to the board; 0: none.
    _Atomic int32_t driver_pid;
    // Set before the first byte that moves a wheel is written, cleared after a stop that the board
    // has confirmed.
    _Atomic bool may_move;
    // The driver wants the wheels to stand and cannot make them: whoever can helps.
    _Atomic bool needs_help;
    // A command has stopped the robot: who drives next waits to be armed.
    _Atomic bool latched;
    // The configuration was read anew: who drives next waits for the button or a command.
    _Atomic bool reloaded;
};

// @return memory that children share, or NULL.
struct watch *watch_make(void);

int64_t watch_now_us(void);
void watch_beat(struct watch *watch, enum watch_role role);

// How long a process has been silent.
int64_t watch_silent_ms(const struct watch *watch, enum watch_role role);

#endif

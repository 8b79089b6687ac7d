// SPDX-License-Identifier: Apache-2.0
#include "guard.h"

#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/prctl.h>
#include <unistd.h>

#include "priority.h"
#include "say.h"
#include "stopper.h"

#define TICK_MS 20
// What the supervisor has, before the guard does its work.
#define HEAD_START_MS 60
// An orphan that cannot stop the wheels gives up after this long.
#define ORPHAN_PATIENCE_MS 60000
// A driver that lost its supervisor stops the wheels and ends; after this long it is killed.
#define DRIVER_ENDS_MS 1000

struct guard
{
    struct watch *watch;
    struct stopper stopper;
    pid_t supervisor;
    int32_t watchdog_ms;
    int64_t orphan_since_us;
    bool complained;
};

// `killall turbopi` and `pkill -f turbopi` are meant for others.
static void change_name(const struct options *options)
{
    static const char name[] = "wheelguard";
    (void)prctl(PR_SET_NAME, name);
    char *line = options->argv[0];
    const char *last = options->argv[options->argc - 1];
    const size_t bytes = (size_t)(last + strlen(last) - line);
    memset(line, 0, bytes);
    memcpy(line, name, sizeof name < bytes ? sizeof name - 1 : 0);
}

static int64_t orphan_ms(struct guard *guard)
{
    const bool is_orphan = getppid() != guard->supervisor;
    if (is_orphan && guard->orphan_since_us == 0)
    {
        guard->orphan_since_us = watch_now_us();
    }
    return is_orphan ? (watch_now_us() - guard->orphan_since_us) / 1000 : -1;
}

static bool must_act(const struct guard *guard, int64_t orphan_for_ms)
{
    const int64_t silent_ms = watch_silent_ms(guard->watch, WATCH_DRIVER);
    return (guard->watch->may_move && silent_ms > guard->watchdog_ms + HEAD_START_MS) ||
           orphan_for_ms > (guard->watch->may_move ? guard->watchdog_ms : DRIVER_ENDS_MS);
}

static void act(struct guard *guard)
{
    const bool moved = guard->watch->may_move;
    if (stopper_end_driver(&guard->stopper, guard->watch))
    {
        if (moved)
        {
            say("guard: the driving process hung or was left alone: the wheels are stopped");
        }
        guard->complained = false;
    }
    else if (!guard->complained && watch_silent_ms(guard->watch, WATCH_DRIVER) > 1000)
    {
        say("guard: motor board: does not confirm a stop: THE WHEELS MAY TURN: switch the robot off");
        guard->complained = true;
    }
}

// A board that is lost can come back under its name only when nobody holds what it was.
static void keep_board(struct guard *guard)
{
    if (guard->watch->needs_help)
    {
        stopper_close(&guard->stopper);
    }
    else
    {
        stopper_hold(&guard->stopper);
    }
}

static bool is_done(const struct guard *guard, int64_t orphan_for_ms)
{
    const bool stands = !guard->watch->may_move && guard->watch->driver_pid == 0;
    return orphan_for_ms > (stands ? -1 : ORPHAN_PATIENCE_MS);
}

_Noreturn void guard_run(const struct options *options, struct watch *watch, pid_t supervisor)
{
    sigset_t all;
    sigfillset(&all);
    (void)sigprocmask(SIG_BLOCK, &all, NULL);
    (void)setsid();
    priority_take(PRIORITY_WATCHES);
    struct guard guard = {
        .watch = watch,
        .stopper = {.config = &options->config, .dry_run = options->dry_run},
        .supervisor = supervisor,
        .watchdog_ms = options->config.watchdog_ms,
    };
    change_name(options);
    for (;;)
    {
        watch_beat(watch, WATCH_GUARD);
        const int64_t orphan_for_ms = orphan_ms(&guard);
        if (is_done(&guard, orphan_for_ms))
        {
            _exit(0);
        }
        if (must_act(&guard, orphan_for_ms))
        {
            act(&guard);
        }
        else
        {
            keep_board(&guard);
        }
        (void)poll(NULL, 0, TICK_MS);
    }
}

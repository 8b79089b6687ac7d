// SPDX-License-Identifier: Apache-2.0
#include "stop_command.h"

#include <glob.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "devices.h"
#include "instance.h"
#include "say.h"
#include "stopper.h"
#include "supervisor.h"

// A board that is only heard is heard within this.
#define PATIENCE_MS 2000
#define PAUSE_MS 20
// Two cells; what says otherwise at the board's address on a bus that nobody named is no robot.
#define PACK_MIN_MV 3000
#define PACK_MAX_MV 9000

enum outcome
{
    OUTCOME_NOTHING,
    OUTCOME_TOLD,
    OUTCOME_CONFIRMED,
};

// Boards that the configuration names: one, or one of each kind.
#define NAMED_MAX 2

struct named
{
    struct app_config config[NAMED_MAX];
    struct stopper stopper[NAMED_MAX];
    int count;
};

static void name_boards(struct named *named, const struct options *options)
{
    static const char *const kinds[NAMED_MAX] = {"i2c", "uart"};
    const bool is_known = options->dry_run || strcmp(options->config.board, "auto") != 0;
    named->count = is_known ? 1 : NAMED_MAX;
    for (int i = 0; i < named->count; ++i)
    {
        named->config[i] = options->config;
        if (!is_known)
        {
            (void)snprintf(named->config[i].board, CONFIG_TEXT_MAX, "%s", kinds[i]);
        }
        named->stopper[i] =
            (struct stopper){.config = &named->config[i], .dry_run = options->dry_run};
    }
}

// Tells all of them zero, again and again, until one has confirmed it. The other kind is then not
// there.
// @param says what came of it; the program that has a board may write to it again.
static enum outcome stop_named(struct named *named, bool says)
{
    const int64_t end_us = watch_now_us() + PATIENCE_MS * 1000;
    for (;;)
    {
        bool told = false;
        for (int i = 0; i < named->count; ++i)
        {
            struct stopper *stopper = &named->stopper[i];
            const char *path = devices_board_path(stopper->config, stopper->dry_run);
            if (stopper_stop(stopper))
            {
                if (says)
                {
                    say("%s: zero to all wheels, confirmed", path != NULL ? path : "stub");
                }
                return OUTCOME_CONFIRMED;
            }
            told = told || stopper->was_told;
            if (says && stopper->was_told && watch_now_us() >= end_us)
            {
                say("%s: zero to all wheels, NOT CONFIRMED by the board", path);
            }
        }
        if (watch_now_us() >= end_us)
        {
            return told ? OUTCOME_TOLD : OUTCOME_NOTHING;
        }
        (void)poll(NULL, 0, PAUSE_MS);
    }
}

// A board on a bus or line that nobody named, if it answers as one.
static enum outcome stop_if_there(const struct app_config *config)
{
    struct named named = {.config = {*config}, .count = 1};
    struct stopper *stopper = &named.stopper[0];
    char error[CONFIG_ERROR_MAX];
    int32_t pack_mV = 0;
    stopper->config = &named.config[0];
    if (!devices_make_board(config, false, &stopper->drivers, &stopper->devices, error))
    {
        return OUTCOME_NOTHING;
    }
    stopper->is_made = true;
    const int64_t end_us = watch_now_us() + PATIENCE_MS * 1000;
    enum fw_err err = hal_battery_read(&stopper->devices.battery, &pack_mV);
    while (err == FW_ERR_TIMEOUT && watch_now_us() < end_us)
    {
        (void)poll(NULL, 0, PAUSE_MS);
        err = hal_battery_read(&stopper->devices.battery, &pack_mV);
    }
    const bool is_board = err == FW_OK && pack_mV >= PACK_MIN_MV && pack_mV <= PACK_MAX_MV;
    const enum outcome outcome = is_board ? stop_named(&named, true) : OUTCOME_NOTHING;
    stopper_close(stopper);
    return outcome;
}

// @return the better of what came of it, and of before.
static enum outcome search_kind(const struct app_config *config, const char *kind,
                                const char *pattern, enum outcome before)
{
    struct app_config other = *config;
    glob_t found;
    if (glob(pattern, GLOB_BRACE, NULL, &found) != 0)
    {
        return before;
    }
    (void)snprintf(other.board, sizeof other.board, "%s", kind);
    char *path = kind[0] == 'i' ? other.i2c_device : other.uart_device;
    for (size_t i = 0; i < found.gl_pathc; ++i)
    {
        (void)snprintf(path, CONFIG_TEXT_MAX, "%s", found.gl_pathv[i]);
        const enum outcome outcome = stop_if_there(&other);
        before = outcome > before ? outcome : before;
    }
    globfree(&found);
    return before;
}

// The Pi's own buses and lines first. What hangs on USB may be anything, and opening alone resets
// some of it: that is asked only if no board has confirmed.
static enum outcome search(const struct app_config *config, enum outcome best)
{
    best = search_kind(config, "i2c", "/dev/i2c-*", best);
    best = search_kind(config, "uart", "/dev/{ttyAMA*,ttyS0}", best);
    return best == OUTCOME_CONFIRMED ? best
                                     : search_kind(config, "uart", "/dev/tty{USB,ACM}*", best);
}

// Asks the program that has a board to end. @return its pid, 0 if there is none.
static pid_t end_holder(const char *path)
{
    const pid_t holder = path != NULL ? instance_holder(path) : 0;
    if (holder > 0)
    {
        (void)kill(holder, SIGTERM);
    }
    return holder;
}

// Waits until it has ended. @return false if it goes on.
static bool wait_for_holder(const char *path, pid_t holder)
{
    const int64_t end_us = watch_now_us() + PATIENCE_MS * 1000;
    pid_t now = 0;
    bool is_free = instance_take(path, &now) >= 0;
    while (!is_free && watch_now_us() < end_us)
    {
        (void)poll(NULL, 0, PAUSE_MS);
        is_free = instance_take(path, &now) >= 0;
    }
    if (!is_free)
    {
        char who[INSTANCE_WHO_MAX] = "another program";
        if (holder > 0)
        {
            instance_describe(holder, who);
        }
        say("%s: %s has it and goes on: end it as its user or as root", path, who);
    }
    return is_free;
}

// systemd runs this after a service that found its board in other hands, too.
static bool was_refused(void)
{
    const char *result = getenv("SERVICE_RESULT"), *status = getenv("EXIT_STATUS");
    return result != NULL && status != NULL && atoi(status) == SUPERVISOR_EXIT_HELD;
}

int stop_command(const struct options *options)
{
    static struct named named;
    if (was_refused())
    {
        say("another program has the motor board: it is left alone");
        return 0;
    }
    name_boards(&named, options);
    bool is_left = true, was_held = false;
    pid_t holders[NAMED_MAX] = {0};
    for (int i = 0; i < named.count; ++i)
    {
        holders[i] = end_holder(devices_board_path(&named.config[i], options->dry_run));
        was_held = was_held || holders[i] != 0;
    }
    // At once, whatever becomes of who has it; what that wrote last may come after this stop.
    enum outcome outcome = stop_named(&named, !was_held);
    for (int i = 0; i < named.count; ++i)
    {
        const char *path = devices_board_path(&named.config[i], options->dry_run);
        is_left = (holders[i] == 0 || wait_for_holder(path, holders[i])) && is_left;
    }
    if (was_held)
    {
        outcome = stop_named(&named, true);
    }
    if (outcome != OUTCOME_CONFIRMED || !options->is_whole)
    {
        outcome = search(&options->config, outcome);
    }
    if (outcome != OUTCOME_CONFIRMED)
    {
        say("no board has confirmed a stop: THE WHEELS MAY TURN: switch the robot off");
    }
    return outcome == OUTCOME_CONFIRMED && is_left ? 0 : 1;
}

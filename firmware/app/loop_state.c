// SPDX-License-Identifier: Apache-2.0
#include "loop_state.h"

#include <stdio.h>
#include <string.h>

#include "say.h"

#define RETRY_US 500000
// A robot that stands looks now and then whether another program moves it.
#define CONFIRM_PERIOD_US 500000

int64_t loop_now_us(const struct loop *loop)
{
    return hal_clock_monotonic_us(&loop->devices.clock);
}

static const char part_names[LOOP_PART_COUNT][sizeof "motor board"] = {"camera", "motor board",
                                                                       "battery", "panel"};

// The watchers know it before the board does.
static void set_may_move(struct loop *loop, bool may_move, bool needs_help)
{
    loop->may_move = may_move;
    if (loop->watch != NULL)
    {
        loop->watch->may_move = may_move;
        loop->watch->needs_help = needs_help;
        // A board that makes this process try again and again keeps it busy, not dead.
        watch_beat(loop->watch, WATCH_DRIVER);
    }
}

enum fw_err loop_halt(struct loop *loop)
{
    enum fw_err err = hal_motors_stop(&loop->devices.motors);
    if (err == FW_OK && (loop->may_move || loop_now_us(loop) >= loop->confirm_us))
    {
        err = hal_motors_confirm(&loop->devices.motors);
        loop->confirm_us = loop_now_us(loop) + CONFIRM_PERIOD_US;
    }
    if (err == FW_OK)
    {
        memset(loop->wheel_duty_pct, 0, sizeof loop->wheel_duty_pct);
    }
    set_may_move(loop, err != FW_OK, err != FW_OK);
    return err;
}

enum fw_err loop_drive(struct loop *loop, const int8_t wheel_duty_pct[FW_WHEEL_COUNT])
{
    static const int8_t zero_pct[FW_WHEEL_COUNT] = {0};
    if (memcmp(wheel_duty_pct, zero_pct, sizeof zero_pct) == 0)
    {
        return loop_halt(loop);
    }
    set_may_move(loop, true, false);
    const enum fw_err err = hal_motors_write(&loop->devices.motors, wheel_duty_pct);
    if (err == FW_OK)
    {
        memcpy(loop->wheel_duty_pct, wheel_duty_pct, sizeof loop->wheel_duty_pct);
    }
    else
    {
        // At once: this process may be the only one that cannot.
        set_may_move(loop, true, true);
    }
    return err;
}

static void tell_loss(const struct loop *loop, enum loop_part part, enum fw_err err)
{
    char reason[LOOP_REASON_MAX];
    const struct loop_devices *devices = &loop->devices;
    (void)snprintf(reason, sizeof reason, "%s", fw_err_str(err));
    if (devices->explain != NULL)
    {
        devices->explain(devices->config, part, err, reason);
    }
    say("%s: %s: the robot stands still until it is back", part_names[part], reason);
}

void loop_lose(struct loop *loop, enum loop_part part, enum fw_err err)
{
    const enum fw_err stop_err = loop_halt(loop);
    const bool is_new = loop->lost[part] != err && err != FW_ERR_END;
    loop->lost[part] = err;
    loop->retry_us[part] = loop_now_us(loop) + RETRY_US;
    if (is_new)
    {
        tell_loss(loop, part, err);
    }
    if (stop_err != FW_OK && loop->lost[LOOP_BOARD] == FW_OK)
    {
        loop->lost[LOOP_BOARD] = stop_err;
        say("%s: %s: THE WHEELS MAY TURN", part_names[LOOP_BOARD], fw_err_str(stop_err));
    }
}

void loop_regain(struct loop *loop, enum loop_part part)
{
    if (loop->lost[part] != FW_OK)
    {
        say("%s: works", part_names[part]);
        loop->lost[part] = FW_OK;
    }
}

void loop_start(struct loop *loop)
{
    loop->running = true;
    loop->plan.waits = false;
    loop->script_over = false;
    loop->script_begin_us = loop_now_us(loop);
}

void loop_stop(struct loop *loop)
{
    loop->running = false;
    loop->plan.waits = false;
}

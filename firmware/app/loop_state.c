// SPDX-License-Identifier: Apache-2.0
#include "loop_state.h"

#include <stdio.h>

#define RETRY_US 500000

int64_t loop_now_us(const struct loop *loop)
{
    return hal_clock_monotonic_us(&loop->devices.clock);
}

static const char *const part_names[LOOP_PART_COUNT] = {"camera", "motor board", "battery",
                                                        "panel"};

void loop_lose(struct loop *loop, enum loop_part part, enum fw_err err)
{
    if (loop->lost[part] != err && err != FW_ERR_END)
    {
        (void)fprintf(stderr, "turbopi: %s: %s: the robot stands still until it is back\n",
                      part_names[part], fw_err_str(err));
    }
    loop->lost[part] = err;
    loop->retry_us[part] = loop_now_us(loop) + RETRY_US;
    const enum fw_err stop_err = hal_motors_stop(&loop->devices.motors);
    loop->moving = loop->moving && stop_err != FW_OK;
    if (stop_err != FW_OK && loop->lost[LOOP_BOARD] == FW_OK)
    {
        loop->lost[LOOP_BOARD] = stop_err;
    }
}

void loop_regain(struct loop *loop, enum loop_part part)
{
    if (loop->lost[part] != FW_OK)
    {
        (void)fprintf(stderr, "turbopi: %s: works\n", part_names[part]);
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

// SPDX-License-Identifier: Apache-2.0
#include "loop_link.h"

#include <stdio.h>

void loop_link_init(struct loop *loop, const struct app_config *config)
{
    struct loop_link *state = &loop->operator_link;
    *state = (struct loop_link){
        .session_begin_us = loop_now_us(loop),
        .configured_timeout_ms = config->link_timeout_ms,
    };
    loop->filter.session = loop->link.session;
    loop->filter.latched = latch_open(&state->latch, config->run_dir, loop_now_us(loop));
}

int64_t loop_link_session_us(const struct loop *loop)
{
    return loop_now_us(loop) - loop->operator_link.session_begin_us;
}

void loop_link_obeyed(struct loop *loop, const struct fw_command *command)
{
    struct loop_link *state = &loop->operator_link;
    fw_command_obeyed(&loop->filter, command, loop_link_session_us(loop));
    if (command->verb == FW_VERB_STOP)
    {
        return;
    }
    state->heard_us = loop_now_us(loop);
    if (command->verb == FW_VERB_START || command->verb == FW_VERB_SCRIPT)
    {
        state->timeout_ms =
            command->link_timeout_ms >= 0 ? command->link_timeout_ms : state->configured_timeout_ms;
        state->lost = false;
    }
}

void loop_link_start_by_hand(struct loop *loop)
{
    loop->operator_link.timeout_ms = 0;
    loop->operator_link.lost = false;
    loop->filter.latched = false;
    loop_start(loop);
}

bool loop_link_is_held(const struct loop *loop)
{
    const struct loop_link *state = &loop->operator_link;
    return loop_now_us(loop) - state->heard_us <= (int64_t)state->timeout_ms * 1000;
}

void loop_link_watch(struct loop *loop)
{
    struct loop_link *state = &loop->operator_link;
    const bool drives = loop->running || loop->plan.waits;
    if (drives && state->timeout_ms > 0 && !loop_link_is_held(loop))
    {
        loop_stop(loop);
        state->lost = true;
    }
}

void loop_link_answer(struct loop *loop, const struct link_ack *ack)
{
    struct loop_link *state = &loop->operator_link;
    if (state->ack_count < LOOP_LINK_ACKS_MAX)
    {
        state->acks[state->ack_count++] = *ack;
    }
}

static bool stands(const struct loop *loop)
{
    return !loop->may_move && loop->lost[LOOP_BOARD] == FW_OK;
}

// A driver or a program that dies after a stop must not come back and drive. Without the folder, as
// where the program is run by hand, only its own processes know of the stop.
static void keep_latch(struct loop *loop)
{
    if (loop->watch != NULL)
    {
        loop->watch->latched = loop->filter.latched;
    }
    latch_keep(&loop->operator_link.latch, loop->filter.latched, loop_now_us(loop));
}

// What whoever is obeyed should know besides.
static void remark(const struct loop *loop, struct link_ack *ack)
{
    if (ack->verb == FW_VERB_STOP && loop->operator_link.latch.is_lost)
    {
        (void)snprintf(ack->reason, sizeof ack->reason,
                       "stands, but forgets this stop if started anew: run_dir cannot be written");
    }
    else if (ack->verb == FW_VERB_ARM && ack->accepted)
    {
        (void)snprintf(ack->reason, sizeof ack->reason, "armed; the robot's key is %s",
                       loop->link.key_name);
    }
    else if ((ack->verb == FW_VERB_START || ack->verb == FW_VERB_SCRIPT) && ack->accepted &&
             loop->core.config.duty_cap_pct == 0)
    {
        (void)snprintf(ack->reason, sizeof ack->reason,
                       "no wheel turns: duty_cap_pct is 0 in its file");
    }
    else if (ack->verb == FW_VERB_SELECT && ack->accepted && loop->plan.waits &&
             (loop->plan.plays_script || loop->plan.behavior[0] != '\0'))
    {
        (void)snprintf(ack->reason, sizeof ack->reason, "a start that it waits for plays %s",
                       loop->plan.plays_script ? "a script" : loop->plan.behavior);
    }
}

void loop_link_tell(struct loop *loop)
{
    struct loop_link *state = &loop->operator_link;
    keep_latch(loop);
    for (int i = 0; i < state->ack_count; ++i)
    {
        struct link_ack *ack = &state->acks[i];
        remark(loop, ack);
        ack->stands = stands(loop);
        ack->utime_us = hal_clock_unix_us(&loop->devices.clock);
        ack->session_us = loop_link_session_us(loop);
        loop->link.send_ack(loop->link.context, ack);
    }
    state->ack_count = 0;
}

void loop_link_report(const struct loop *loop, struct link_report *report)
{
    const struct loop_link *state = &loop->operator_link;
    const bool untethered = loop->running && state->timeout_ms == 0;
    report->session_us = loop_link_session_us(loop);
    report->counter = loop->filter.counter;
    report->stands = stands(loop);
    report->link_timeout_ms = state->timeout_ms;
    report->status_flags |= (state->lost ? LINK_STATUS_LINK_LOST : 0) |
                            (untethered ? LINK_STATUS_UNTETHERED : 0) |
                            (state->latch.is_lost ? LINK_STATUS_LATCH_LOST : 0) |
                            (loop->devices.dry_run ? LINK_STATUS_DRY_RUN : 0) |
                            (loop->plan.waits ? LINK_STATUS_AWAITS_START : 0) |
                            (loop->filter.latched ? LINK_STATUS_LATCHED : 0);
}

// SPDX-License-Identifier: Apache-2.0
#include "loop_commands.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "loop_link.h"

#define COMMANDS_PER_STEP 8

// Reads at most size bytes of a file, without the C library's streams, which take heap.
// @return how many, or -1 and errno.
static ssize_t read_file(const char *path, char *text, size_t size)
{
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
    {
        return -1;
    }
    size_t length = 0;
    ssize_t got = 1;
    while (got > 0 && length < size)
    {
        got = read(fd, text + length, size - length);
        length += got > 0 ? (size_t)got : 0;
    }
    const int error = errno;
    (void)close(fd);
    errno = error;
    return got < 0 ? -1 : (ssize_t)length;
}

bool loop_load_script(struct loop *loop, const char *path, char reason[LINK_REASON_MAX])
{
    // 128 KB hold the longest script at 32 bytes a row; too much for a stack.
    static char text[32 * LOOP_SCRIPT_MAX_ROWS];
    const ssize_t length = read_file(path, text, sizeof text);
    if (length < 0)
    {
        (void)snprintf(reason, LINK_REASON_MAX, "script cannot be read: %s", strerror(errno));
        return false;
    }
    if ((size_t)length == sizeof text)
    {
        (void)snprintf(reason, LINK_REASON_MAX, "script is 128 KB or more: make it shorter");
        return false;
    }
    int32_t line;
    const enum fw_script_fault fault = fw_script_parse(text, (size_t)length, &loop->script, &line);
    if (fault != FW_SCRIPT_OK)
    {
        loop->script.row_count = 0;
        (void)snprintf(reason, LINK_REASON_MAX, "script, line %d: %s", line,
                       fw_script_fault_str(fault));
        return false;
    }
    return true;
}

static bool knows_behavior(const struct loop *loop, const char *name, char *reason)
{
    const struct fw_table *table = own_tables_find(loop->own, name);
    const bool known = table != NULL && fw_table_check(table) == FW_OK;
    if (!known)
    {
        (void)snprintf(reason, LINK_REASON_MAX, "no behaviour '%s'", name);
        return false;
    }
    const bool sees = table->bit_count <= loop->core.config.bit_count;
    if (!sees)
    {
        (void)snprintf(reason, LINK_REASON_MAX, "'%s' needs bit%d configured", name,
                       table->bit_count);
    }
    return sees;
}

static bool select_behavior(struct loop *loop, const char *name, char *reason)
{
    if (!knows_behavior(loop, name, reason) ||
        fw_set_table(&loop->core, own_tables_find(loop->own, name)) != FW_OK)
    {
        return false;
    }
    loop->plays_script = false;
    (void)snprintf(loop->behavior, sizeof loop->behavior, "%s", name);
    return true;
}

static bool load_named_script(struct loop *loop, const char *name, char *reason)
{
    char path[CONFIG_TEXT_MAX + LINK_NAME_MAX + 2];
    if (name[0] == '\0' || name[0] == '.' || strchr(name, '/') != NULL)
    {
        (void)snprintf(reason, LINK_REASON_MAX, "script must be a file name without folder");
        return false;
    }
    (void)snprintf(path, sizeof path, "%s/%s", loop->script_dir, name);
    return loop_load_script(loop, path, reason);
}

static bool may_start(const struct loop *loop, char *reason)
{
    if (loop->battery_low)
    {
        (void)snprintf(reason, LINK_REASON_MAX, "battery low: charge it, then restart");
    }
    return !loop->battery_low;
}

// What a plan will play is checked when it is made: selecting it cannot fail.
static void start_if_due(struct loop *loop)
{
    char reason[LINK_REASON_MAX];
    struct loop_plan *plan = &loop->plan;
    if (!plan->waits || loop_now_us(loop) < plan->at_us)
    {
        return;
    }
    if (plan->behavior[0] != '\0')
    {
        (void)select_behavior(loop, plan->behavior, reason);
    }
    loop->plays_script = loop->plays_script || plan->plays_script;
    loop_start(loop);
}

// Until its instant a start changes nothing, whatever the robot does now.
static void plan_start(struct loop *loop, const struct link_command *command)
{
    const int64_t until_us =
        command->order.start_utime_us - hal_clock_unix_us(&loop->devices.clock);
    loop->plan = (struct loop_plan){
        .waits = true,
        .at_us = loop_now_us(loop) + (until_us > 0 ? until_us : 0),
        .plays_script = command->order.verb == FW_VERB_SCRIPT,
    };
    if (command->order.verb == FW_VERB_START)
    {
        memcpy(loop->plan.behavior, command->name, sizeof loop->plan.behavior);
    }
    start_if_due(loop);
}

static bool obey(struct loop *loop, const struct link_command *command, char *reason)
{
    bool starts = false;
    switch ((enum fw_verb)command->order.verb)
    {
        case FW_VERB_STOP: loop_stop(loop); return true;
        case FW_VERB_SELECT: return select_behavior(loop, command->name, reason);
        case FW_VERB_START:
            starts = may_start(loop, reason) &&
                     (command->name[0] == '\0' || knows_behavior(loop, command->name, reason));
            break;
        case FW_VERB_SCRIPT:
            starts = may_start(loop, reason) && load_named_script(loop, command->name, reason);
            break;
        case FW_VERB_ARM:
        case FW_VERB_HOLD: return true;
    }
    if (starts)
    {
        plan_start(loop, command);
    }
    return starts;
}

static void answer(struct loop *loop, const struct link_command *command)
{
    const struct fw_command *order = &command->order;
    struct link_ack ack = {
        .seq = order->seq, .command_utime_us = order->utime_us, .verb = order->verb};
    const enum fw_verdict verdict =
        fw_command_judge(&loop->filter, order, hal_clock_unix_us(&loop->devices.clock),
                         loop_link_session_us(loop), loop->running);
    const bool is_forged = verdict == FW_VERDICT_FORGED;
    (void)snprintf(ack.reason, sizeof ack.reason, is_forged ? "%s this robot's is %s" : "%s",
                   fw_verdict_str(verdict), loop->link.key_name);
    const bool obeyed = verdict == FW_VERDICT_OBEY && obey(loop, command, ack.reason);
    if (obeyed)
    {
        loop_link_obeyed(loop, order);
    }
    ack.accepted = obeyed || verdict == FW_VERDICT_COPY;
    if (order->verb != FW_VERB_HOLD)
    {
        loop_link_answer(loop, &ack);
    }
}

void loop_obey_commands(struct loop *loop)
{
    struct link_command command;
    for (int i = 0; i < COMMANDS_PER_STEP && loop->link.receive(loop->link.context, &command); ++i)
    {
        answer(loop, &command);
    }
    loop_link_watch(loop);
    start_if_due(loop);
}

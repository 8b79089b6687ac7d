// SPDX-License-Identifier: Apache-2.0
#include "fw/command.h"

static bool is_copy(const struct fw_inbox *inbox, const struct fw_command *command)
{
    return inbox->obeyed_utime_us != 0 && command->utime_us == inbox->obeyed_utime_us &&
           command->seq == inbox->obeyed_seq;
}

static bool clocks_agree(const struct fw_command *command, int64_t now_utime_us)
{
    // Compared without a difference of stamps: those of a broken sender may be anything.
    return command->start_utime_us == 0 ||
           (command->start_utime_us <= now_utime_us + FW_START_AHEAD_US &&
            command->start_utime_us >= now_utime_us - FW_START_LATE_US);
}

enum fw_verdict fw_command_judge(const struct fw_inbox *inbox, const struct fw_command *command,
                                 int64_t now_utime_us, bool running)
{
    if (command->verb == FW_VERB_STOP)
    {
        return FW_VERDICT_OBEY;
    }
    if (is_copy(inbox, command))
    {
        return FW_VERDICT_COPY;
    }
    if (command->utime_us < inbox->obeyed_utime_us)
    {
        return FW_VERDICT_OLD;
    }
    switch (command->verb)
    {
        case FW_VERB_SELECT: return FW_VERDICT_OBEY;
        case FW_VERB_START: break;
        case FW_VERB_SCRIPT:
            if (running)
            {
                return FW_VERDICT_RUNNING;
            }
            break;
        default: return FW_VERDICT_UNKNOWN;
    }
    return clocks_agree(command, now_utime_us) ? FW_VERDICT_OBEY : FW_VERDICT_CLOCK;
}

void fw_command_obeyed(struct fw_inbox *inbox, const struct fw_command *command)
{
    if (command->utime_us >= inbox->obeyed_utime_us)
    {
        inbox->obeyed_utime_us = command->utime_us;
        inbox->obeyed_seq = command->seq;
    }
}

const char *fw_verdict_str(enum fw_verdict verdict)
{
    switch (verdict)
    {
        case FW_VERDICT_OBEY:
        case FW_VERDICT_COPY: return "";
        case FW_VERDICT_OLD: return "older than a command already obeyed";
        case FW_VERDICT_UNKNOWN: return "unknown verb";
        case FW_VERDICT_CLOCK:
            return "start is over 2 s ago or over 600 s ahead: are the clocks set?";
        case FW_VERDICT_RUNNING: return "running: stop before choosing a script";
    }
    return "unknown verdict";
}

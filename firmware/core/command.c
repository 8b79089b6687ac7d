// SPDX-License-Identifier: Apache-2.0
#include "fw/command.h"

static bool is_copy(const struct fw_command_filter *filter, const struct fw_command *command)
{
    return command->counter == filter->counter && command->seq == filter->obeyed_seq &&
           command->verb == filter->obeyed_verb;
}

static bool is_start(const struct fw_command *command)
{
    return command->verb == FW_VERB_START || command->verb == FW_VERB_SCRIPT;
}

static bool clocks_agree(const struct fw_command *command, int64_t now_utime_us)
{
    // Compared without a difference of stamps: those of a broken sender may be anything.
    return command->start_utime_us == 0 ||
           (command->start_utime_us <= now_utime_us + FW_START_AHEAD_US &&
            command->start_utime_us >= now_utime_us - FW_START_LATE_US);
}

// Is it from who may command, and for this run of the program?
static enum fw_verdict judge_sender(const struct fw_command_filter *filter,
                                    const struct fw_command *command)
{
    switch ((enum fw_seal)command->seal)
    {
        case FW_SEAL_GOOD: break;
        case FW_SEAL_WRONG: return FW_VERDICT_FORGED;
        case FW_SEAL_NO_KEY: return FW_VERDICT_NO_KEY;
        case FW_SEAL_NONE:
        default: return FW_VERDICT_UNSIGNED;
    }
    const bool is_ours = filter->session != 0 && command->session == filter->session;
    return is_ours ? FW_VERDICT_OBEY : FW_VERDICT_SESSION;
}

// Made just now, and after the last stop.
static bool is_fresh(const struct fw_command_filter *filter, const struct fw_command *command,
                     int64_t session_us)
{
    return command->made_us >= session_us - FW_COMMAND_FRESH_US &&
           command->made_us <= session_us + FW_COMMAND_AHEAD_US &&
           (!filter->latched || command->made_us > filter->stopped_us);
}

// Does the robot's state allow it, at the instant that it names?
static enum fw_verdict judge_state(const struct fw_command_filter *filter,
                                   const struct fw_command *command, int64_t now_utime_us,
                                   bool running)
{
    if (command->counter <= filter->counter)
    {
        return FW_VERDICT_OLD;
    }
    if (command->verb == FW_VERB_SCRIPT && running)
    {
        return FW_VERDICT_RUNNING;
    }
    return is_start(command) && !clocks_agree(command, now_utime_us) ? FW_VERDICT_CLOCK
                                                                     : FW_VERDICT_OBEY;
}

enum fw_verdict fw_command_judge(const struct fw_command_filter *filter,
                                 const struct fw_command *command, int64_t now_utime_us,
                                 int64_t session_us, bool running)
{
    if (command->verb == FW_VERB_STOP)
    {
        return FW_VERDICT_OBEY;
    }
    if (command->verb < FW_VERB_STOP || command->verb > FW_VERB_HOLD)
    {
        return FW_VERDICT_UNKNOWN;
    }
    const enum fw_verdict verdict = judge_sender(filter, command);
    if (verdict != FW_VERDICT_OBEY)
    {
        return verdict;
    }
    if (filter->latched && is_start(command))
    {
        return FW_VERDICT_LATCHED;
    }
    if (command->verb != FW_VERB_HOLD && is_copy(filter, command))
    {
        return FW_VERDICT_COPY;
    }
    if (!is_fresh(filter, command, session_us))
    {
        return FW_VERDICT_EXPIRED;
    }
    // That the operator is there has no order: it says nothing but that.
    return command->verb == FW_VERB_HOLD ? FW_VERDICT_OBEY
                                         : judge_state(filter, command, now_utime_us, running);
}

void fw_command_obeyed(struct fw_command_filter *filter, const struct fw_command *command,
                       int64_t session_us)
{
    if (command->verb == FW_VERB_STOP)
    {
        filter->latched = true;
        filter->stopped_us = session_us;
        return;
    }
    if (command->verb == FW_VERB_HOLD || command->counter <= filter->counter)
    {
        return;
    }
    filter->latched = filter->latched && command->verb != FW_VERB_ARM;
    filter->counter = command->counter;
    filter->obeyed_seq = command->seq;
    filter->obeyed_verb = command->verb;
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
        case FW_VERDICT_UNSIGNED: return "not signed: only a stop may be";
        case FW_VERDICT_FORGED: return "its signature is wrong: signed with another key?";
        case FW_VERDICT_NO_KEY: return "the robot has no key: `twinmill robot flash` brings it one";
        case FW_VERDICT_SESSION: return "made for an earlier run of the robot's program";
        case FW_VERDICT_EXPIRED:
            return "came over 3 s after it was made, or was made before the stop";
        case FW_VERDICT_LATCHED: return "was stopped: arm it first (`twinmill swarm arm`)";
    }
    return "unknown verdict";
}

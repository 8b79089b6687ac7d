// SPDX-License-Identifier: Apache-2.0
// Which of an operator's commands a robot obeys. Commands are repeated until acknowledged, and
// copies come late or in another order: a late copy of an old one must not undo a newer one. A stop
// is always obeyed.
#ifndef FW_COMMAND_H
#define FW_COMMAND_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

// A start further ahead, or longer ago, says that the clocks differ.
#define FW_START_AHEAD_US 600000000
#define FW_START_LATE_US 2000000

// As in swarm_command_t.
enum fw_verb
{
    FW_VERB_STOP = 0,
    FW_VERB_START = 1,
    FW_VERB_SELECT = 2,
    FW_VERB_SCRIPT = 3,
};

struct fw_command
{
    // By the sender's clock; with seq, what tells commands apart.
    int64_t utime_us;
    int32_t seq;
    int8_t verb;
    // By the robot's clock; 0 = now.
    int64_t start_utime_us;
};

// The newest command that was obeyed; all zero before the first.
struct fw_inbox
{
    int64_t obeyed_utime_us;
    int32_t obeyed_seq;
};

enum fw_verdict
{
    FW_VERDICT_OBEY = 0,
    // A copy of the newest command obeyed: acknowledge it, do nothing.
    FW_VERDICT_COPY,
    // The rest are refusals.
    FW_VERDICT_OLD,
    FW_VERDICT_UNKNOWN,
    FW_VERDICT_CLOCK,
    FW_VERDICT_RUNNING,
};

// @param now_utime_us by the robot's clock. @param running scripts are chosen by robots that stand.
enum fw_verdict fw_command_judge(const struct fw_inbox *inbox, const struct fw_command *command,
                                 int64_t now_utime_us, bool running);

// To be called for every command that was obeyed.
void fw_command_obeyed(struct fw_inbox *inbox, const struct fw_command *command);

// Why a command is refused, as a reason for ack_t; empty if it is not. Never NULL.
const char *fw_verdict_str(enum fw_verdict verdict);

#ifdef __cplusplus
}
#endif

#endif

// SPDX-License-Identifier: Apache-2.0
// Which of an operator's commands a robot obeys. A stop always, whoever says it; it holds until the
// robot is armed again. All else must be signed, be for this session, and come in time and in
// order: commands are repeated until acknowledged, recorded, and delayed, and none of that may undo
// a newer one. Signatures themselves are checked elsewhere.
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
// A command is void this long after it was made: what is kept back does not move a robot later.
#define FW_COMMAND_FRESH_US 3000000
// The sender's notion of the robot's clock may be ahead by this.
#define FW_COMMAND_AHEAD_US 1000000

// As in swarm_command_t and signed_command_t.
enum fw_verb
{
    FW_VERB_STOP = 0,
    FW_VERB_START = 1,
    FW_VERB_SELECT = 2,
    FW_VERB_SCRIPT = 3,
    FW_VERB_ARM = 4,
    FW_VERB_HOLD = 5,
};

// What is known of a command's signature.
enum fw_seal
{
    FW_SEAL_NONE = 0,
    FW_SEAL_GOOD,
    FW_SEAL_WRONG,
    // The robot has no key to check it by.
    FW_SEAL_NO_KEY,
};

struct fw_command
{
    // By the sender's clock.
    int64_t utime_us;
    int32_t seq;
    int8_t verb;
    // By the robot's clock; 0 = now.
    int64_t start_utime_us;
    // One of fw_seal. The rest, as in signed_command_t, is 0 where there is no signature.
    int8_t seal;
    int64_t session;
    int64_t made_us;
    int64_t counter;
    int32_t link_timeout_ms;
};

struct fw_command_filter
{
    // Of this run of the robot's program; 0: not set, nothing signed is obeyed.
    int64_t session;
    // The newest signed command that was obeyed.
    int64_t counter;
    int32_t obeyed_seq;
    int8_t obeyed_verb;
    // After a stop, until armed by a command that was made after it.
    bool latched;
    int64_t stopped_us;
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
    FW_VERDICT_UNSIGNED,
    FW_VERDICT_FORGED,
    FW_VERDICT_NO_KEY,
    FW_VERDICT_SESSION,
    FW_VERDICT_EXPIRED,
    FW_VERDICT_LATCHED,
};

// @param now_utime_us by the robot's clock. @param session_us since the session began.
// @param running scripts are chosen by robots that stand.
enum fw_verdict fw_command_judge(const struct fw_command_filter *filter,
                                 const struct fw_command *command, int64_t now_utime_us,
                                 int64_t session_us, bool running);

// To be called for every command that was obeyed. @param session_us as above.
void fw_command_obeyed(struct fw_command_filter *filter, const struct fw_command *command,
                       int64_t session_us);

// Why a command is refused, as a reason for ack_t; empty if it is not. Never NULL.
const char *fw_verdict_str(enum fw_verdict verdict);

#ifdef __cplusplus
}
#endif

#endif

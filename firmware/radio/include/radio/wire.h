// SPDX-License-Identifier: Apache-2.0
// Commands as bytes: every length that a message claims is checked against what there is.
#ifndef RADIO_WIRE_H
#define RADIO_WIRE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fw/command.h"
#include "radio/seal.h"

#ifdef __cplusplus
extern "C" {
#endif

#define WIRE_NAME_MAX 48
#define WIRE_COMMAND_CHANNEL "SWARM_COMMAND"
#define WIRE_SIGNED_CHANNEL "SWARM_SIGNED"
#define WIRE_ALL_ROBOTS (-1)

struct wire_command
{
    struct fw_command order;
    int32_t robot_id;
    // Table or script; longer names are cut, and known to nobody.
    char name[WIRE_NAME_MAX];
};

// Reads a swarm_command_t. @return false if it is none; then command is untouched.
bool wire_read_command(const uint8_t *bytes, size_t size, struct wire_command *command);

// Reads a signed_command_t and the command in it.
// @param key of the robot that it says it is for; decides order.seal.
bool wire_read_signed(const uint8_t *bytes, size_t size, const struct seal_key *key,
                      struct wire_command *command);

// The robot that a signed_command_t says it is for. @return false if it is none.
bool wire_peek_robot(const uint8_t *bytes, size_t size, int32_t *robot_id);

// The session in a link_t. @return false if it is none.
bool wire_peek_session(const uint8_t *bytes, size_t size, int64_t *session);

#ifdef __cplusplus
}
#endif

#endif

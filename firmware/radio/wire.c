// SPDX-License-Identifier: Apache-2.0
#include "radio/wire.h"

#include <string.h>
#include <turbopi_link_t.h>
#include <turbopi_signed_command_t.h>
#include <turbopi_swarm_command_t.h>

// What is left to be read; LCM's numbers are big-endian.
struct cursor
{
    const uint8_t *next;
    size_t left;
    // Something was asked for that is not there; all later numbers are 0.
    bool short_of;
};

static uint64_t take(struct cursor *in, size_t count)
{
    in->short_of = in->short_of || in->left < count;
    if (in->short_of)
    {
        return 0;
    }
    uint64_t value = 0;
    for (size_t i = 0; i < count; ++i)
    {
        value = value << 8 | in->next[i];
    }
    in->next += count;
    in->left -= count;
    return value;
}

static int64_t take_64(struct cursor *in)
{
    return (int64_t)take(in, 8);
}

static int32_t take_32(struct cursor *in)
{
    return (int32_t)take(in, 4);
}

static bool is_of_type(struct cursor *in, int64_t fingerprint)
{
    return take_64(in) == fingerprint && !in->short_of;
}

bool wire_read_command(const uint8_t *bytes, size_t size, struct wire_command *command)
{
    struct cursor in = {bytes, size, false};
    if (!is_of_type(&in, __turbopi_swarm_command_t_get_hash()))
    {
        return false;
    }
    struct wire_command read = {.order = {.utime_us = take_64(&in), .seq = take_32(&in)}};
    read.robot_id = take_32(&in);
    read.order.verb = (int8_t)take(&in, 1);
    read.order.start_utime_us = take_64(&in);
    const uint32_t length = (uint32_t)take(&in, 4);
    // The text's length counts its final 0, and nothing follows.
    if (in.short_of || length == 0 || length != in.left || in.next[length - 1] != 0)
    {
        return false;
    }
    const size_t kept = length < sizeof read.name ? length : sizeof read.name;
    memcpy(read.name, in.next, kept);
    read.name[sizeof read.name - 1] = '\0';
    *command = read;
    return true;
}

bool wire_read_signed(const uint8_t *bytes, size_t size, const struct seal_key *key,
                      struct wire_command *command)
{
    struct cursor in = {bytes, size, false};
    if (!is_of_type(&in, __turbopi_signed_command_t_get_hash()))
    {
        return false;
    }
    (void)take_64(&in);
    const int32_t robot_id = take_32(&in);
    const int64_t session = take_64(&in), made_us = take_64(&in), counter = take_64(&in);
    const int32_t link_timeout_ms = take_32(&in);
    const uint32_t length = (uint32_t)take(&in, 4);
    struct wire_command read;
    if (in.short_of || in.left < SEAL_TAG_BYTES || length != in.left - SEAL_TAG_BYTES ||
        !wire_read_command(in.next, length, &read))
    {
        return false;
    }
    read.robot_id = robot_id;
    read.order.seal = !key->present                   ? FW_SEAL_NO_KEY
                      : seal_verify(key, bytes, size) ? FW_SEAL_GOOD
                                                      : FW_SEAL_WRONG;
    read.order.session = session;
    read.order.made_us = made_us;
    read.order.counter = counter;
    read.order.link_timeout_ms = link_timeout_ms;
    *command = read;
    return true;
}

bool wire_peek_robot(const uint8_t *bytes, size_t size, int32_t *robot_id)
{
    struct cursor in = {bytes, size, false};
    if (!is_of_type(&in, __turbopi_signed_command_t_get_hash()))
    {
        return false;
    }
    (void)take_64(&in);
    *robot_id = take_32(&in);
    return !in.short_of;
}

bool wire_peek_session(const uint8_t *bytes, size_t size, int64_t *session)
{
    struct cursor in = {bytes, size, false};
    if (!is_of_type(&in, __turbopi_link_t_get_hash()))
    {
        return false;
    }
    (void)take(&in, 8);
    (void)take(&in, 4);
    *session = take_64(&in);
    return !in.short_of;
}

// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/radio/wire.c, on messages as LCM's own encoder writes them.
#include "radio/wire.h"

#include <stdlib.h>
#include <string.h>
#include <turbopi_link_t.h>
#include <turbopi_signed_command_t.h>
#include <turbopi_swarm_command_t.h>

#include "unity.h"

// Fixture

static struct wire_command heard;
static struct seal_key key;
static uint8_t bytes[512];

void setUp(void)
{
    memset(&heard, 0, sizeof heard);
    key.present = true;
    memset(key.bytes, 5, sizeof key.bytes);
}

void tearDown(void) {}

static size_t encode(char *behavior)
{
    const turbopi_swarm_command_t message = {.utime_us = 5,
                                             .seq = 7,
                                             .robot_id = 3,
                                             .verb = FW_VERB_START,
                                             .start_utime_us = 9,
                                             .behavior = behavior};
    return (size_t)turbopi_swarm_command_t_encode(bytes, 0, sizeof bytes, &message);
}

// A command for robot 4 in an envelope for robot 3.
static size_t encode_signed(void)
{
    uint8_t inner[128];
    const turbopi_swarm_command_t command = {
        .utime_us = 5, .seq = 7, .robot_id = 4, .verb = FW_VERB_ARM, .behavior = "orbit"};
    turbopi_signed_command_t message = {.utime_us = 1,
                                        .robot_id = 3,
                                        .session = -2,
                                        .made_us = 4,
                                        .counter = 6,
                                        .link_timeout_ms = 8,
                                        .command = inner};
    message.command_size = turbopi_swarm_command_t_encode(inner, 0, sizeof inner, &command);
    const size_t size = (size_t)turbopi_signed_command_t_encode(bytes, 0, sizeof bytes, &message);
    seal_sign(&key, bytes, size);
    return size;
}

// In a block of just their size.
static bool read_plain(size_t size)
{
    uint8_t *block = malloc(size > 0 ? size : 1);
    memcpy(block, bytes, size);
    const bool ok = wire_read_command(block, size, &heard);
    free(block);
    return ok;
}

static bool read_signed(size_t size)
{
    uint8_t *block = malloc(size > 0 ? size : 1);
    memcpy(block, bytes, size);
    const bool ok = wire_read_signed(block, size, &key, &heard);
    free(block);
    return ok;
}

// Test

static void test_command_is_read_whole(void)
{
    TEST_ASSERT_TRUE(read_plain(encode("orbit")));
    TEST_ASSERT_EQUAL_INT64(5, heard.order.utime_us);
    TEST_ASSERT_EQUAL(7, heard.order.seq);
    TEST_ASSERT_EQUAL(3, heard.robot_id);
    TEST_ASSERT_EQUAL(FW_VERB_START, heard.order.verb);
    TEST_ASSERT_EQUAL_INT64(9, heard.order.start_utime_us);
    TEST_ASSERT_EQUAL_STRING("orbit", heard.name);
    TEST_ASSERT_EQUAL(FW_SEAL_NONE, heard.order.seal);
}

static void test_long_name_is_cut(void)
{
    char name[200];
    memset(name, 'n', sizeof name);
    name[sizeof name - 1] = '\0';
    TEST_ASSERT_TRUE(read_plain(encode(name)));
    TEST_ASSERT_EQUAL(WIRE_NAME_MAX - 1, strlen(heard.name));
}

static void test_text_without_an_end_is_ignored(void)
{
    const size_t count = encode("orbit");
    bytes[count - 1] = 't';
    TEST_ASSERT_FALSE(read_plain(count));
}

// Lengths that the text has not: none, shorter, longer, below zero, huge.
static void test_text_of_another_length_is_ignored(void)
{
    static const uint32_t lengths[] = {0, 5, 7, UINT32_MAX, UINT32_C(0x7FFFFFFF)};
    for (size_t i = 0; i < sizeof lengths / sizeof lengths[0]; ++i)
    {
        const size_t count = encode("orbit");
        uint8_t *length = bytes + count - sizeof "orbit" - 4;
        TEST_ASSERT_EQUAL(sizeof "orbit", length[3]);
        for (int byte = 0; byte < 4; ++byte)
        {
            length[byte] = (uint8_t)(lengths[i] >> (24 - 8 * byte));
        }
        TEST_ASSERT_FALSE(read_plain(count));
    }
}

static void test_beginning_of_a_message_is_ignored(void)
{
    for (size_t part = 0, count = encode("orbit"); part < count; ++part)
    {
        TEST_ASSERT_FALSE(read_plain(part));
    }
    for (size_t part = 0, count = encode_signed(); part < count; ++part)
    {
        TEST_ASSERT_FALSE(read_signed(part));
    }
}

static void test_message_of_another_type_is_ignored(void)
{
    size_t count = encode("orbit");
    TEST_ASSERT_FALSE(read_signed(count));
    bytes[0] ^= 1;
    TEST_ASSERT_FALSE(read_plain(count));
    count = encode_signed();
    TEST_ASSERT_FALSE(read_plain(count));
}

static void test_signed_command_is_for_whom_the_envelope_names(void)
{
    int32_t robot_id = 0;
    const size_t size = encode_signed();
    TEST_ASSERT_TRUE(read_signed(size));
    TEST_ASSERT_EQUAL(3, heard.robot_id);
    TEST_ASSERT_EQUAL(FW_SEAL_GOOD, heard.order.seal);
    TEST_ASSERT_EQUAL(FW_VERB_ARM, heard.order.verb);
    TEST_ASSERT_EQUAL_INT64(-2, heard.order.session);
    TEST_ASSERT_EQUAL_INT64(4, heard.order.made_us);
    TEST_ASSERT_EQUAL_INT64(6, heard.order.counter);
    TEST_ASSERT_EQUAL(8, heard.order.link_timeout_ms);
    TEST_ASSERT_EQUAL_STRING("orbit", heard.name);
    TEST_ASSERT_TRUE(wire_peek_robot(bytes, size, &robot_id));
    TEST_ASSERT_EQUAL(3, robot_id);
}

// Whatever bit is changed, what is read is not signed.
static void test_forged_command_is_known(void)
{
    const size_t size = encode_signed();
    for (size_t bit = 0; bit < 8 * size; ++bit)
    {
        bytes[bit / 8] ^= (uint8_t)(1u << bit % 8);
        TEST_ASSERT_FALSE(read_signed(size) && heard.order.seal == FW_SEAL_GOOD);
        bytes[bit / 8] ^= (uint8_t)(1u << bit % 8);
    }
    key.present = false;
    TEST_ASSERT_TRUE(read_signed(size));
    TEST_ASSERT_EQUAL(FW_SEAL_NO_KEY, heard.order.seal);
}

static void test_session_is_read_from_a_link(void)
{
    int64_t session = 0;
    const turbopi_link_t link = {.utime_us = 1, .robot_id = 2, .session = -3};
    const size_t size = (size_t)turbopi_link_t_encode(bytes, 0, sizeof bytes, &link);
    TEST_ASSERT_TRUE(wire_peek_session(bytes, size, &session));
    TEST_ASSERT_EQUAL_INT64(-3, session);
    TEST_ASSERT_FALSE(wire_peek_session(bytes, 27, &session));
    TEST_ASSERT_FALSE(wire_peek_session(bytes, encode("orbit"), &session));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_command_is_read_whole);
    RUN_TEST(test_long_name_is_cut);
    RUN_TEST(test_text_without_an_end_is_ignored);
    RUN_TEST(test_text_of_another_length_is_ignored);
    RUN_TEST(test_beginning_of_a_message_is_ignored);
    RUN_TEST(test_message_of_another_type_is_ignored);
    RUN_TEST(test_signed_command_is_for_whom_the_envelope_names);
    RUN_TEST(test_forged_command_is_known);
    RUN_TEST(test_session_is_read_from_a_link);
    return UNITY_END();
}

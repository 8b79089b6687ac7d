// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/app/telemetry.c, on LCM's bus inside the process.
#include "telemetry.h"

#include <string.h>
#include <turbopi_swarm_command_t.h>

#include "unity.h"

// Fixture

static struct app_config config;
static struct telemetry telemetry;
static struct link_command heard;
static int heard_count;

static void on_command(void *context, const struct link_command *command)
{
    (void)context;
    heard = *command;
    ++heard_count;
}

void setUp(void)
{
    config_default(&config);
    config.robot_id = 3;
    strcpy(config.lcm_url, "memq://");
    telemetry_init(&telemetry, &config, on_command, NULL);
    telemetry_connect(&telemetry, 0);
    TEST_ASSERT_NOT_NULL(telemetry.lcm);
    heard_count = 0;
}

void tearDown(void)
{
    telemetry_close(&telemetry);
}

// A message as LCM's own encoder writes it. @return its bytes.
static unsigned encode(int32_t robot_id, char *behavior, uint8_t bytes[256])
{
    const turbopi_swarm_command_t message = {
        .utime_us = 5, .seq = 7, .robot_id = robot_id, .verb = FW_VERB_START, .behavior = behavior};
    return (unsigned)turbopi_swarm_command_t_encode(bytes, 0, 256, &message);
}

// The bytes as they would come from the network, in a block of just their size.
static void send(const uint8_t *bytes, unsigned count)
{
    TEST_ASSERT_EQUAL(0, lcm_publish(telemetry.lcm, "SWARM_COMMAND", bytes, count));
    telemetry_handle(&telemetry);
}

// Test

static void test_command_is_heard_by_whom_it_names(void)
{
    uint8_t bytes[256];
    send(bytes, encode(3, "orbit", bytes));
    TEST_ASSERT_EQUAL(1, heard_count);
    TEST_ASSERT_EQUAL(7, heard.order.seq);
    TEST_ASSERT_EQUAL(FW_VERB_START, heard.order.verb);
    TEST_ASSERT_EQUAL_STRING("orbit", heard.name);
    send(bytes, encode(-1, "", bytes));
    TEST_ASSERT_EQUAL(2, heard_count);
    send(bytes, encode(4, "orbit", bytes));
    TEST_ASSERT_EQUAL(2, heard_count);
}

static void test_text_without_an_end_is_ignored(void)
{
    uint8_t bytes[256];
    const unsigned count = encode(3, "orbit", bytes);
    bytes[count - 1] = 't';
    send(bytes, count);
    TEST_ASSERT_EQUAL(0, heard_count);
}

// Lengths that the text has not: none, shorter, longer, below zero, huge.
static void test_text_of_another_length_is_ignored(void)
{
    static const uint32_t lengths[] = {0, 5, 7, UINT32_MAX, UINT32_C(0x7FFFFFFF)};
    for (size_t i = 0; i < sizeof lengths / sizeof lengths[0]; ++i)
    {
        uint8_t bytes[256];
        const unsigned count = encode(3, "orbit", bytes);
        uint8_t *length = bytes + count - sizeof "orbit" - 4;
        TEST_ASSERT_EQUAL(sizeof "orbit", length[3]);
        for (int byte = 0; byte < 4; ++byte)
        {
            length[byte] = (uint8_t)(lengths[i] >> (24 - 8 * byte));
        }
        send(bytes, count);
    }
    TEST_ASSERT_EQUAL(0, heard_count);
}

static void test_beginning_of_a_message_is_ignored(void)
{
    uint8_t bytes[256];
    const unsigned count = encode(3, "orbit", bytes);
    for (unsigned part = 0; part < count; ++part)
    {
        send(bytes, part);
    }
    TEST_ASSERT_EQUAL(0, heard_count);
}

static void test_message_of_another_type_is_ignored(void)
{
    uint8_t bytes[256];
    const unsigned count = encode(3, "orbit", bytes);
    bytes[0] ^= 1;
    send(bytes, count);
    TEST_ASSERT_EQUAL(0, heard_count);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_command_is_heard_by_whom_it_names);
    RUN_TEST(test_text_without_an_end_is_ignored);
    RUN_TEST(test_text_of_another_length_is_ignored);
    RUN_TEST(test_beginning_of_a_message_is_ignored);
    RUN_TEST(test_message_of_another_type_is_ignored);
    return UNITY_END();
}

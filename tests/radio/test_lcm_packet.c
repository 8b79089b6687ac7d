// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/radio/lcm_packet.c. The format is LCM's own: "LC02", four bytes of count, the
// channel and its 0, the message (lcm-proj.github.io, "UDP multicast protocol description"). All
// packets here are read or refused by liblcm 1.3.1 and 1.5.3, too; what else may come is left to
// the fuzzers, which make it up as they run.
#include "radio/lcm_packet.h"

#include <stdlib.h>
#include <string.h>

#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

// Fixture

static struct lcm_packet packet;

// Reads a block of just that size, so that a sanitizer sees what is read past it.
static bool read_block(const void *bytes, size_t size)
{
    static uint8_t *block;
    free(block);
    block = malloc(size > 0 ? size : 1);
    TEST_ASSERT_NOT_NULL(block);
    memcpy(block, bytes, size);
    return lcm_packet_read(block, size, &packet);
}

// Test

static void test_message_is_channel_and_data(void)
{
    TEST_ASSERT_TRUE(read_block("LC02\0\0\0\7CHANNEL\0data", 20));
    TEST_ASSERT_EQUAL_STRING("CHANNEL", packet.channel);
    TEST_ASSERT_EQUAL(4, packet.size);
    TEST_ASSERT_EQUAL_MEMORY("data", packet.data, 4);
    TEST_ASSERT_TRUE(read_block("LC02\0\0\0\7C\0", 10));
    TEST_ASSERT_EQUAL(0, packet.size);
}

static void test_header_alone_or_less_is_no_message(void)
{
    for (size_t size = 0; size <= 8; ++size)
    {
        TEST_ASSERT_FALSE(read_block("LC02\0\0\0\7", size));
    }
}

static void test_channel_too_long_is_no_message(void)
{
    char bytes[8 + LCM_PACKET_CHANNEL_MAX + 2] = "LC02\0\0\0\7";
    memset(bytes + 8, 'c', LCM_PACKET_CHANNEL_MAX + 1);
    TEST_ASSERT_FALSE(read_block(bytes, sizeof bytes));
    bytes[8 + LCM_PACKET_CHANNEL_MAX] = '\0';
    TEST_ASSERT_TRUE(read_block(bytes, sizeof bytes));
    TEST_ASSERT_EQUAL(LCM_PACKET_CHANNEL_MAX, strlen(packet.channel));
}

// A whole message as LC03: count 1, size 4, offset 0, fragment 0 of 1.
static void test_fragment_is_no_message(void)
{
    TEST_ASSERT_FALSE(read_block("LC03\0\0\0\1\0\0\0\4\0\0\0\0\0\0\0\1SWARM_COMMAND\0data", 38));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_message_is_channel_and_data);
    RUN_TEST(test_header_alone_or_less_is_no_message);
    RUN_TEST(test_channel_too_long_is_no_message);
    RUN_TEST(test_fragment_is_no_message);
    return UNITY_END();
}

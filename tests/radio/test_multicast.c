// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/radio/multicast.c. That networks which change are heard: tests/field.
#include "radio/multicast.h"

#include <arpa/inet.h>

#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

static struct in_addr group;
static uint16_t port;

// The address and port that LCM's documentation gives as its own.
static void test_parts_of_a_url_may_be_missing(void)
{
    static const char *const urls[] = {"udpm://239.255.76.67:7667?ttl=1", "udpm://:7667",
                                       "udpm://239.255.76.67", "udpm://?ttl=0", "udpm://"};
    for (size_t i = 0; i < sizeof urls / sizeof urls[0]; ++i)
    {
        TEST_ASSERT_TRUE_MESSAGE(multicast_parse(urls[i], &group, &port), urls[i]);
        TEST_ASSERT_EQUAL_HEX32(0xEFFF4C43, ntohl(group.s_addr));
        TEST_ASSERT_EQUAL(7667, port);
    }
    TEST_ASSERT_TRUE(multicast_parse("udpm://224.0.0.9:1", &group, &port));
    TEST_ASSERT_EQUAL_HEX32(0xE0000009, ntohl(group.s_addr));
    TEST_ASSERT_EQUAL(1, port);
}

static void test_what_is_no_multicast_url_is_refused(void)
{
    static const char *const urls[] = {"",
                                       "tcpq://localhost:7700",
                                       "udpm://10.0.0.1:7667",
                                       "udpm://239.255.76.67:0",
                                       "udpm://239.255.76.67:65536",
                                       "udpm://239.255.76.67:x",
                                       "udpm://239.255.76.67:76 67",
                                       "udpm://239.255.76.67.239.255.76.67",
                                       "udpm://host:7667",
                                       "udpm:/"};
    for (size_t i = 0; i < sizeof urls / sizeof urls[0]; ++i)
    {
        TEST_ASSERT_FALSE_MESSAGE(multicast_parse(urls[i], &group, &port), urls[i]);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parts_of_a_url_may_be_missing);
    RUN_TEST(test_what_is_no_multicast_url_is_refused);
    return UNITY_END();
}

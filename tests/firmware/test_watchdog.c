// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/watchdog.c
#include "fw/watchdog.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

// Test

static void test_frame_expires_only_when_older_than_the_timeout(void)
{
    TEST_ASSERT_FALSE(fw_watchdog_expired(1000, 1000, 200000));
    TEST_ASSERT_FALSE(fw_watchdog_expired(1000, 201000, 200000));
    TEST_ASSERT_TRUE(fw_watchdog_expired(1000, 201001, 200000));
}

static void test_frame_from_the_future_has_expired(void)
{
    TEST_ASSERT_TRUE(fw_watchdog_expired(1001, 1000, 200000));
}

static void test_any_two_times_can_be_compared(void)
{
    TEST_ASSERT_TRUE(fw_watchdog_expired(INT64_MIN, INT64_MAX, INT64_MAX));
    TEST_ASSERT_TRUE(fw_watchdog_expired(INT64_MAX, INT64_MIN, INT64_MAX));
    TEST_ASSERT_FALSE(fw_watchdog_expired(-5, INT64_MAX - 5, INT64_MAX));
}

// All duties and all caps against the definition of a clamp.
static void test_cap_clamps_every_duty_and_says_so(void)
{
    for (int cap_pct = 0; cap_pct <= 100; ++cap_pct)
    {
        for (int duty_pct = -128; duty_pct <= 127; ++duty_pct)
        {
            const int clamped_pct = duty_pct > cap_pct    ? cap_pct
                                    : duty_pct < -cap_pct ? -cap_pct
                                                          : duty_pct;
            for (int wheel = 0; wheel < FW_WHEEL_COUNT; ++wheel)
            {
                int8_t duties_pct[FW_WHEEL_COUNT] = {0};
                duties_pct[wheel] = (int8_t)duty_pct;
                const bool capped = fw_duty_cap(duties_pct, cap_pct);
                TEST_ASSERT_EQUAL_INT(clamped_pct, duties_pct[wheel]);
                TEST_ASSERT_EQUAL(clamped_pct != duty_pct, capped);
            }
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_frame_expires_only_when_older_than_the_timeout);
    RUN_TEST(test_frame_from_the_future_has_expired);
    RUN_TEST(test_any_two_times_can_be_compared);
    RUN_TEST(test_cap_clamps_every_duty_and_says_so);
    return UNITY_END();
}

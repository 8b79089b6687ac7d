// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/app/reporter.c: the loop never waits for the network.
#include "reporter.h"

#include <string.h>
#include <time.h>

#include "unity.h"

// Fixture

static struct app_config config;
static struct reporter reporter;
static struct link link;
static const struct seal_key no_key;

void setUp(void)
{
    config_default(&config);
    strcpy(config.lcm_url, "");
}

void tearDown(void) {}

static int64_t now_us(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

// Test

// Ten minutes of steps at once: what the thread cannot take is lost, and the caller goes on.
static void test_flood_of_reports_is_dropped_and_told_to_the_loop(void)
{
    TEST_ASSERT_EQUAL(FW_OK, reporter_start(&reporter, &config, &no_key, &link));
    const struct link_report report = {.utime_us = 1};
    int taken = 0, lost = 0;
    const int64_t begin_us = now_us();
    for (int i = 0; i < 18000; ++i)
    {
        const bool ok = link.send_report(link.context, &report);
        taken += ok;
        lost += !ok;
    }
    TEST_ASSERT_LESS_THAN_INT64(5000000, now_us() - begin_us);
    TEST_ASSERT_EQUAL(18000, taken + lost);
    TEST_ASSERT_GREATER_THAN(100, taken);
    struct link_command command;
    TEST_ASSERT_FALSE(link.receive(link.context, &command));
    reporter_stop(&reporter);
}

// A second's reports fit even if the thread is not run meanwhile.
static void test_second_of_reports_fits(void)
{
    TEST_ASSERT_EQUAL(FW_OK, reporter_start(&reporter, &config, &no_key, &link));
    const struct link_report report = {.utime_us = 1};
    for (int i = 0; i < 30; ++i)
    {
        TEST_ASSERT_TRUE(link.send_report(link.context, &report));
    }
    reporter_stop(&reporter);
    // Without a bus all of them are counted as unsent.
    TEST_ASSERT_EQUAL(30, reporter.telemetry.unsent_count);
}

static void test_log_that_cannot_be_opened_is_an_error(void)
{
    strcpy(config.io_tsv, "/nowhere/io.tsv");
    TEST_ASSERT_EQUAL(FW_ERR_IO, reporter_start(&reporter, &config, &no_key, &link));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_flood_of_reports_is_dropped_and_told_to_the_loop);
    RUN_TEST(test_second_of_reports_fits);
    RUN_TEST(test_log_that_cannot_be_opened_is_an_error);
    return UNITY_END();
}

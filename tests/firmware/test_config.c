// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/config.c
#include "fw/config.h"
#include "unity.h"

static struct fw_config config;

void setUp(void)
{
    config = fw_config_default();
}
void tearDown(void) {}

// Test

// The camera's only format, the authors' area threshold and vote, and their main program.
static void test_default_is_the_authors_robot_and_in_range(void)
{
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_config_check(&config));
    TEST_ASSERT_EQUAL_INT(640, config.width_px);
    TEST_ASSERT_EQUAL_INT(480, config.height_px);
    TEST_ASSERT_EQUAL_INT(300, config.bits[0].min_blob_px);
    TEST_ASSERT_EQUAL_INT(10, config.bits[0].vote.max_frames);
    TEST_ASSERT_EQUAL_INT(100, config.table.rows[1].speed_input_pct);
    TEST_ASSERT_EQUAL_INT(500, config.table.rows[1].turn_input_milli);
}

static void test_sizes_out_of_range_are_refused(void)
{
    const int bad[][2] = {{0, 480}, {-2, 480}, {641, 480}, {1282, 480}, {640, 0}, {640, 1025}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i)
    {
        config.width_px = bad[i][0];
        config.height_px = bad[i][1];
        TEST_ASSERT_EQUAL_INT(FW_ERR_FRAME_SIZE, fw_config_check(&config));
    }
    config.width_px = 1280;
    config.height_px = 1024;
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_config_check(&config));
}

static void test_each_empty_side_of_the_box_is_refused(void)
{
    const struct fw_color_box boxes[] = {
        {2, 1, 0, 255, 0, 255}, {0, 255, 2, 1, 0, 255}, {0, 255, 0, 255, 2, 1}};
    for (int i = 0; i < 3; ++i)
    {
        config.bits[0].box = boxes[i];
        TEST_ASSERT_EQUAL_INT(FW_ERR_BOX, fw_config_check(&config));
    }
}

static void test_blob_below_zero_is_refused(void)
{
    config.bits[0].min_blob_px = -1;
    TEST_ASSERT_EQUAL_INT(FW_ERR_MIN_BLOB, fw_config_check(&config));
}

static void test_timeout_of_zero_is_refused(void)
{
    config.frame_timeout_us = 0;
    TEST_ASSERT_EQUAL_INT(FW_ERR_FRAME_TIMEOUT, fw_config_check(&config));
}

static void test_cap_outside_percent_is_refused(void)
{
    config.duty_cap_pct = -1;
    TEST_ASSERT_EQUAL_INT(FW_ERR_DUTY_CAP, fw_config_check(&config));
    config.duty_cap_pct = 101;
    TEST_ASSERT_EQUAL_INT(FW_ERR_DUTY_CAP, fw_config_check(&config));
}

static void test_vote_and_table_are_looked_at(void)
{
    config.table.rows[1].turn_input_milli = 2001;
    TEST_ASSERT_EQUAL_INT(FW_ERR_INPUT_RANGE, fw_config_check(&config));
    config.bits[0].vote.max_frames = 0;
    TEST_ASSERT_EQUAL_INT(FW_ERR_VOTE, fw_config_check(&config));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_default_is_the_authors_robot_and_in_range);
    RUN_TEST(test_sizes_out_of_range_are_refused);
    RUN_TEST(test_each_empty_side_of_the_box_is_refused);
    RUN_TEST(test_blob_below_zero_is_refused);
    RUN_TEST(test_timeout_of_zero_is_refused);
    RUN_TEST(test_cap_outside_percent_is_refused);
    RUN_TEST(test_vote_and_table_are_looked_at);
    return UNITY_END();
}

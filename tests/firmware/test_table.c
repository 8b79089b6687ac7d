// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/table.c
#include "fw/table.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

// Test

static void test_lookup_takes_the_row_of_the_bit(void)
{
    const struct fw_table table = {.unseen = {1, 2}, .seen = {3, 4}};
    TEST_ASSERT_EQUAL_INT(1, fw_table_lookup(&table, false).speed_input_pct);
    TEST_ASSERT_EQUAL_INT(2, fw_table_lookup(&table, false).turn_input_milli);
    TEST_ASSERT_EQUAL_INT(3, fw_table_lookup(&table, true).speed_input_pct);
    TEST_ASSERT_EQUAL_INT(4, fw_table_lookup(&table, true).turn_input_milli);
}

// Speed input -100..100 and turn input -2..2 are the robot's published ranges.
static void test_check_takes_the_ends_of_the_range_and_nothing_beyond(void)
{
    for (int sign = -1; sign <= 1; sign += 2)
    {
        const struct fw_input end = {sign * 100, sign * 2000};
        const struct fw_input fast = {sign * 101, 0}, sharp = {0, sign * 2001};
        TEST_ASSERT_EQUAL_INT(FW_OK, fw_input_check(&end));
        TEST_ASSERT_EQUAL_INT(FW_ERR_INPUT_RANGE, fw_input_check(&fast));
        TEST_ASSERT_EQUAL_INT(FW_ERR_INPUT_RANGE, fw_input_check(&sharp));
    }
}

static void test_check_looks_at_both_rows(void)
{
    const struct fw_table good = {{0, 0}, {0, 0}};
    const struct fw_table bad_unseen = {{101, 0}, {0, 0}}, bad_seen = {{0, 0}, {0, -2001}};
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_table_check(&good));
    TEST_ASSERT_EQUAL_INT(FW_ERR_INPUT_RANGE, fw_table_check(&bad_unseen));
    TEST_ASSERT_EQUAL_INT(FW_ERR_INPUT_RANGE, fw_table_check(&bad_seen));
}

// The notation is the command line's; the numbers are milling's as published, and the ends.
static void test_parse_reads_inputs(void)
{
    struct fw_table table;
    TEST_ASSERT_TRUE(fw_table_parse("100,-0.5,100,0.5", &table));
    TEST_ASSERT_EQUAL_INT(100, table.unseen.speed_input_pct);
    TEST_ASSERT_EQUAL_INT(-500, table.unseen.turn_input_milli);
    TEST_ASSERT_EQUAL_INT(100, table.seen.speed_input_pct);
    TEST_ASSERT_EQUAL_INT(500, table.seen.turn_input_milli);
    TEST_ASSERT_TRUE(fw_table_parse("-100,2,0,-2", &table));
    TEST_ASSERT_EQUAL_INT(2000, table.unseen.turn_input_milli);
}

static void test_parse_refuses_all_else_and_touches_nothing(void)
{
    struct fw_table table = {{1, 2}, {3, 4}};
    const char *const bad[] = {"",          "1,1,1",       "1,1,1,1,1", "1,1,1,",
                               "101,0,0,0", "0,2.001,0,0", "0,0,0,-3",  "a,0,0,0",
                               "0,0,0,0 x", "1e12,0,0,0"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i)
    {
        TEST_ASSERT_FALSE_MESSAGE(fw_table_parse(bad[i], &table), bad[i]);
    }
    TEST_ASSERT_EQUAL_INT(1, table.unseen.speed_input_pct);
    TEST_ASSERT_EQUAL_INT(4, table.seen.turn_input_milli);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_lookup_takes_the_row_of_the_bit);
    RUN_TEST(test_check_takes_the_ends_of_the_range_and_nothing_beyond);
    RUN_TEST(test_check_looks_at_both_rows);
    RUN_TEST(test_parse_reads_inputs);
    RUN_TEST(test_parse_refuses_all_else_and_touches_nothing);
    return UNITY_END();
}

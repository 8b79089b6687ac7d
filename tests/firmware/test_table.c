// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/table.c
#include "fw/table.h"

#include <stdio.h>
#include <string.h>

#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

// Test

static void test_lookup_takes_the_row_of_the_bit(void)
{
    const struct fw_table table = {1, {{1, 2}, {3, 4}}};
    TEST_ASSERT_EQUAL_INT(1, fw_table_lookup(&table, false).speed_input_pct);
    TEST_ASSERT_EQUAL_INT(2, fw_table_lookup(&table, false).turn_input_milli);
    TEST_ASSERT_EQUAL_INT(3, fw_table_lookup(&table, true).speed_input_pct);
    TEST_ASSERT_EQUAL_INT(4, fw_table_lookup(&table, true).turn_input_milli);
}

// Speed input -100..100 and turn input -2..2 are the robot's published ranges.
static void test_check_takes_the_ends_of_the_range_and_nothing_beyond(void)
{
    for (int16_t sign = -1; sign <= 1; sign += 2)
    {
        const struct fw_input end = {(int16_t)(sign * 100), (int16_t)(sign * 2000)};
        const struct fw_input fast = {(int16_t)(sign * 101), 0};
        const struct fw_input sharp = {0, (int16_t)(sign * 2001)};
        TEST_ASSERT_EQUAL_INT(FW_OK, fw_input_check(&end));
        TEST_ASSERT_EQUAL_INT(FW_ERR_INPUT_RANGE, fw_input_check(&fast));
        TEST_ASSERT_EQUAL_INT(FW_ERR_INPUT_RANGE, fw_input_check(&sharp));
    }
}

static void test_check_looks_at_both_rows(void)
{
    const struct fw_table good = {1, {{0, 0}, {0, 0}}};
    const struct fw_table bad_unseen = {1, {{101, 0}, {0, 0}}};
    const struct fw_table bad_seen = {1, {{0, 0}, {0, -2001}}};
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_table_check(&good));
    TEST_ASSERT_EQUAL_INT(FW_ERR_INPUT_RANGE, fw_table_check(&bad_unseen));
    TEST_ASSERT_EQUAL_INT(FW_ERR_INPUT_RANGE, fw_table_check(&bad_seen));
}

// The notation is the command line's; the numbers are milling's as published, and the ends.
static void test_parse_reads_inputs(void)
{
    struct fw_table table;
    TEST_ASSERT_TRUE(fw_table_parse("100,-0.5,100,0.5", &table));
    TEST_ASSERT_EQUAL_INT(100, table.rows[0].speed_input_pct);
    TEST_ASSERT_EQUAL_INT(-500, table.rows[0].turn_input_milli);
    TEST_ASSERT_EQUAL_INT(100, table.rows[1].speed_input_pct);
    TEST_ASSERT_EQUAL_INT(500, table.rows[1].turn_input_milli);
    TEST_ASSERT_TRUE(fw_table_parse("-100,2,0,-2", &table));
    TEST_ASSERT_EQUAL_INT(2000, table.rows[0].turn_input_milli);
}

static void test_parse_refuses_all_else_and_touches_nothing(void)
{
    struct fw_table table = {1, {{1, 2}, {3, 4}}};
    const char *const bad[] = {"",          "1,1,1",       "1,1,1,1,1,1", "1,1,1,",
                               "101,0,0,0", "0,2.001,0,0", "0,0,0,-3",    "a,0,0,0",
                               "0,0,0,0 x", "1e12,0,0,0"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i)
    {
        TEST_ASSERT_FALSE_MESSAGE(fw_table_parse(bad[i], &table), bad[i]);
    }
    TEST_ASSERT_EQUAL_INT(1, table.rows[0].speed_input_pct);
    TEST_ASSERT_EQUAL_INT(4, table.rows[1].turn_input_milli);
}

static void test_parse_tells_the_bits_by_the_rows(void)
{
    char text[400] = "";
    struct fw_table table;
    for (int rows = 1; rows <= 2 * FW_MAX_ROWS; ++rows)
    {
        const size_t used = strlen(text);
        (void)snprintf(text + used, sizeof text - used, "%s-100,-1.%03d", used > 0 ? "," : "",
                       rows);
        const bool is_power = rows == 2 || rows == 4 || rows == 8 || rows == 16;
        TEST_ASSERT_EQUAL_INT(is_power, fw_table_parse(text, &table));
        if (is_power)
        {
            TEST_ASSERT_EQUAL_INT(rows, 1 << table.bit_count);
            TEST_ASSERT_EQUAL_INT(-1000 - rows, table.rows[rows - 1].turn_input_milli);
        }
    }
}

static void test_number_of_bits_is_checked(void)
{
    struct fw_table table = {0};
    TEST_ASSERT_EQUAL_INT(FW_ERR_BITS, fw_table_check(&table));
    table.bit_count = 5;
    TEST_ASSERT_EQUAL_INT(FW_ERR_BITS, fw_table_check(&table));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_lookup_takes_the_row_of_the_bit);
    RUN_TEST(test_check_takes_the_ends_of_the_range_and_nothing_beyond);
    RUN_TEST(test_check_looks_at_both_rows);
    RUN_TEST(test_parse_reads_inputs);
    RUN_TEST(test_parse_refuses_all_else_and_touches_nothing);
    RUN_TEST(test_parse_tells_the_bits_by_the_rows);
    RUN_TEST(test_number_of_bits_is_checked);
    return UNITY_END();
}

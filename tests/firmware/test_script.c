// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/script.c and decimal.c
#include "fw/script.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "decimal.h"
#include "support.h"
#include "unity.h"

// Fixture

#define INPUTS "t_s,speed_input,turn_input\n"
#define DUTIES "t_s,fl_pct,fr_pct,rl_pct,rr_pct\n"

static struct fw_script_row rows[4];
static struct fw_script script;
static int32_t line;

void setUp(void)
{
    memset(rows, 0, sizeof rows);
    script = (struct fw_script){.rows = rows, .capacity = 4};
    line = 0;
}

void tearDown(void) {}

static enum fw_script_fault parse(const char *text)
{
    return fw_script_parse(text, strlen(text), &script, &line);
}

static void assert_fault(enum fw_script_fault fault, int32_t at_line, const char *text)
{
    TEST_ASSERT_EQUAL_MESSAGE(fault, parse(text), text);
    TEST_ASSERT_EQUAL_MESSAGE(at_line, line, text);
}

// Test

static void test_inputs_are_read_in_their_units(void)
{
    TEST_ASSERT_EQUAL(FW_SCRIPT_OK, parse(INPUTS "0,100,-0.5\n\n0.25,-7.5,2\r\n1e1,0,.0014"));
    TEST_ASSERT_FALSE(script.has_duties);
    TEST_ASSERT_EQUAL(3, script.row_count);
    TEST_ASSERT_EQUAL(100, rows[0].input.speed_input_pct);
    TEST_ASSERT_EQUAL(-500, rows[0].input.turn_input_milli);
    TEST_ASSERT_EQUAL_INT64(250000, rows[1].t_us);
    TEST_ASSERT_EQUAL(-8, rows[1].input.speed_input_pct);
    TEST_ASSERT_EQUAL(2000, rows[1].input.turn_input_milli);
    TEST_ASSERT_EQUAL_INT64(10000000, rows[2].t_us);
    TEST_ASSERT_EQUAL(1, rows[2].input.turn_input_milli);
}

static void test_duties_are_read_in_the_order_of_wheels(void)
{
    TEST_ASSERT_EQUAL(FW_SCRIPT_OK, parse(DUTIES "0,1,-2,100,-100\n"));
    TEST_ASSERT_TRUE(script.has_duties);
    TEST_ASSERT_EQUAL_INT8_ARRAY(((const int8_t[4]){1, -2, 100, -100}), rows[0].wheel_duty_pct, 4);
}

static void test_row_is_held_until_the_next(void)
{
    TEST_ASSERT_EQUAL(FW_SCRIPT_OK, parse(INPUTS "1,1,0\n2,2,0\n3,3,0\n"));
    TEST_ASSERT_NULL(fw_script_at(&script, 999999));
    TEST_ASSERT_EQUAL_INT64(1000000, fw_script_next_us(&script, 999999));
    TEST_ASSERT_EQUAL_PTR(&rows[0], fw_script_at(&script, 1000000));
    TEST_ASSERT_EQUAL_INT64(2000000, fw_script_next_us(&script, 1000000));
    TEST_ASSERT_EQUAL_PTR(&rows[1], fw_script_at(&script, 2999999));
    TEST_ASSERT_EQUAL_PTR(&rows[2], fw_script_at(&script, INT64_MAX));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fw_script_next_us(&script, 3000000));
}

static void test_mistakes_name_their_line(void)
{
    assert_fault(FW_SCRIPT_HEADER, 1, "");
    assert_fault(FW_SCRIPT_HEADER, 1, "t_s,speed_input\n0,1\n");
    assert_fault(FW_SCRIPT_NO_ROWS, 1, INPUTS);
    assert_fault(FW_SCRIPT_TOO_LONG, 6, INPUTS "0,0,0\n1,0,0\n2,0,0\n3,0,0\n4,0,0\n");
    assert_fault(FW_SCRIPT_COLUMNS, 2, INPUTS "0,1\n");
    assert_fault(FW_SCRIPT_COLUMNS, 2, INPUTS "0,1,0,0\n");
    assert_fault(FW_SCRIPT_COLUMNS, 3, DUTIES "0,1,2,3,4\n1,2,3\n");
    assert_fault(FW_SCRIPT_NUMBER, 2, INPUTS "0,x,0\n");
    assert_fault(FW_SCRIPT_NUMBER, 2, INPUTS "0,1,\n");
    assert_fault(FW_SCRIPT_ORDER, 3, INPUTS "1,0,0\n1,0,0\n");
    assert_fault(FW_SCRIPT_INPUT_RANGE, 2, INPUTS "0,100.4,0\n");
    assert_fault(FW_SCRIPT_INPUT_RANGE, 2, INPUTS "0,0,-2.001\n");
    assert_fault(FW_SCRIPT_DUTY_RANGE, 2, DUTIES "0,0,0,-101,0\n");
}

// printf writes, libm rounds: the two agree with the parser but for halves that binary cannot hold.
static void test_numbers_agree_with_the_c_library(void)
{
    uint32_t random = 3;
    static const char *const formats[] = {"%.0f", "%.3f", "%.7f", "%.4e", "%.12e", "%.15g"};
    for (int i = 0; i < 60000; ++i)
    {
        const double value = ((double)random_next(&random) - 2147483648.0) / 65536.0;
        const int places = (int)(random_next(&random) % 7);
        char text[40];
        const int length = snprintf(text, sizeof text, formats[i % 6], value);
        double written;
        TEST_ASSERT_EQUAL(1, sscanf(text, "%lf", &written));
        const double scaled = written * pow(10, places);
        int64_t parsed = 0;
        TEST_ASSERT_TRUE(fw_decimal_parse(text, (size_t)length, places, &parsed));
        if (fabs(fabs(scaled - trunc(scaled)) - 0.5) > 1e-4)
        {
            TEST_ASSERT_EQUAL_INT64_MESSAGE(llround(scaled), parsed, text);
        }
    }
}

static void test_halves_round_away_from_zero(void)
{
    static const struct
    {
        const char *text;
        int64_t value;
    } cases[] = {{"0.5", 1}, {"-0.5", -1}, {"1.5", 2},    {"2.5", 3}, {"0.49999999999999999999", 0},
                 {"-0", 0},  {"5e-1", 1},  {"12e2", 1200}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i)
    {
        int64_t value = -99;
        TEST_ASSERT_TRUE(fw_decimal_parse(cases[i].text, strlen(cases[i].text), 0, &value));
        TEST_ASSERT_EQUAL_INT64_MESSAGE(cases[i].value, value, cases[i].text);
    }
}

static void test_what_is_no_number_is_refused(void)
{
    const char *const texts[] = {"",      "-",
                                 ".",     "+1",
                                 " 1",    "1 ",
                                 "1e",    "e5",
                                 "0x1",   "inf",
                                 "nan",   "1.2.3",
                                 "1e16",  "1e999999999999",
                                 "--1",   "1-",
                                 "1e+-2", "99999999999999999999999"};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; ++i)
    {
        int64_t value = -99;
        TEST_ASSERT_FALSE_MESSAGE(fw_decimal_parse(texts[i], strlen(texts[i]), 6, &value),
                                  texts[i]);
        TEST_ASSERT_EQUAL_INT64(-99, value);
    }
}

// Any bytes: it returns, reads nothing past the end and writes nothing past the capacity.
static void test_any_bytes_are_read_or_refused(void)
{
    static const char alphabet[] = "0123456789.,-eE\n\r \xFF";
    uint32_t random = 11;
    for (int round = 0; round < 20000; ++round)
    {
        const size_t length = random_next(&random) % 80;
        const size_t header = sizeof INPUTS - 1;
        char *text = malloc(header + length + 1);
        memcpy(text, INPUTS, header);
        for (size_t i = 0; i < length; ++i)
        {
            text[header + i] = alphabet[random_next(&random) % (sizeof alphabet - 1)];
        }
        const enum fw_script_fault fault = fw_script_parse(text, header + length, &script, &line);
        TEST_ASSERT_LESS_OR_EQUAL(4, script.row_count);
        TEST_ASSERT_TRUE(fault == FW_SCRIPT_OK || strcmp(fw_script_fault_str(fault), "ok") != 0);
        free(text);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_inputs_are_read_in_their_units);
    RUN_TEST(test_duties_are_read_in_the_order_of_wheels);
    RUN_TEST(test_row_is_held_until_the_next);
    RUN_TEST(test_mistakes_name_their_line);
    RUN_TEST(test_numbers_agree_with_the_c_library);
    RUN_TEST(test_halves_round_away_from_zero);
    RUN_TEST(test_what_is_no_number_is_refused);
    RUN_TEST(test_any_bytes_are_read_or_refused);
    return UNITY_END();
}

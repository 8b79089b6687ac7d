// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/mixing.c
#include <math.h>

#include "fw/mixing.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

// Fixture

static void assert_sides(int speed_pct, int turn_milli, int left_pct, int right_pct)
{
    int8_t duty_pct[FW_WHEEL_COUNT];
    const struct fw_input input = {(int16_t)speed_pct, (int16_t)turn_milli};
    fw_mix(&input, duty_pct);
    TEST_ASSERT_EQUAL_INT(left_pct, duty_pct[FW_FRONT_LEFT]);
    TEST_ASSERT_EQUAL_INT(right_pct, duty_pct[FW_FRONT_RIGHT]);
    TEST_ASSERT_EQUAL_INT(left_pct, duty_pct[FW_REAR_LEFT]);
    TEST_ASSERT_EQUAL_INT(right_pct, duty_pct[FW_REAR_RIGHT]);
}

static int clamp_pct(double duty_pct)
{
    return (int)trunc(fmin(fmax(duty_pct, -100.0), 100.0));
}

// Test

// The vendor's own table, its turn negated and its direction of 270 degrees a negative speed.
static void test_mix_gives_every_row_of_the_vendors_table(void)
{
    assert_sides(100, -500, 100, 37);
    assert_sides(100, 500, 37, 100);
    assert_sides(100, -650, 100, 18);
    assert_sides(100, 650, 18, 100);
    assert_sides(75, 500, 12, 100);
    assert_sides(100, 2000, -100, 100);
    assert_sides(0, -500, 63, -63);
    assert_sides(0, -2000, 100, -100);
}

// In floating point the vendor's code gives -50 -49 -49 -50 here.
static void test_mix_straight_back_is_the_same_on_all_wheels(void)
{
    assert_sides(-50, 0, -50, -50);
}

static void test_mix_truncates_the_sum_toward_zero(void)
{
    assert_sides(95, -200, 100, 69);  // 95 - 25.2 = 69.8
    assert_sides(0, 300, -37, 37);    // 37.8
}

// The vendor's formula in double precision, for all whole inputs: equal wherever the exact sum is
// not a whole number, where rounding in double precision may fall to either side.
static void test_mix_equals_the_vendors_formula_for_all_inputs(void)
{
    int compared = 0;
    for (int speed_pct = -100; speed_pct <= 100; ++speed_pct)
    {
        for (int turn_milli = -2000; turn_milli <= 2000; ++turn_milli)
        {
            const double clockwise = -turn_milli / 1000.0;
            const double vp_pct = -clockwise * (67 + 59);
            if (126 * turn_milli % 1000 == 0)
            {
                continue;
            }
            int8_t duty_pct[FW_WHEEL_COUNT];
            const struct fw_input input = {(int16_t)speed_pct, (int16_t)turn_milli};
            fw_mix(&input, duty_pct);
            TEST_ASSERT_EQUAL_INT(clamp_pct(speed_pct - vp_pct), duty_pct[FW_FRONT_LEFT]);
            TEST_ASSERT_EQUAL_INT(clamp_pct(speed_pct + vp_pct), duty_pct[FW_FRONT_RIGHT]);
            TEST_ASSERT_EQUAL_INT(clamp_pct(speed_pct - vp_pct), duty_pct[FW_REAR_LEFT]);
            TEST_ASSERT_EQUAL_INT(clamp_pct(speed_pct + vp_pct), duty_pct[FW_REAR_RIGHT]);
            ++compared;
        }
    }
    TEST_ASSERT_TRUE(compared > 201 * 3900);
}

static void test_mix_whole_sums_are_exact(void)
{
    for (int speed_pct = -100; speed_pct <= 100; ++speed_pct)
    {
        assert_sides(speed_pct, 0, speed_pct, speed_pct);
    }
    assert_sides(10, 500, -53, 73);
}

static void test_mix_mirrors_with_the_turn_and_negates_with_the_input(void)
{
    for (int speed_pct = -100; speed_pct <= 100; speed_pct += 3)
    {
        for (int turn_milli = 0; turn_milli <= 2000; turn_milli += 7)
        {
            int8_t duty_pct[FW_WHEEL_COUNT];
            const struct fw_input input = {(int16_t)speed_pct, (int16_t)turn_milli};
            fw_mix(&input, duty_pct);
            const int left_pct = duty_pct[FW_FRONT_LEFT], right_pct = duty_pct[FW_FRONT_RIGHT];
            assert_sides(speed_pct, -turn_milli, right_pct, left_pct);
            assert_sides(-speed_pct, -turn_milli, -left_pct, -right_pct);
        }
    }
}

static void test_mix_stays_in_range_for_any_inputs(void)
{
    assert_sides(INT16_MAX, 0, 100, 100);
    assert_sides(0, INT16_MIN, 100, -100);
    assert_sides(INT16_MIN, INT16_MAX, -100, -100);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_mix_gives_every_row_of_the_vendors_table);
    RUN_TEST(test_mix_straight_back_is_the_same_on_all_wheels);
    RUN_TEST(test_mix_truncates_the_sum_toward_zero);
    RUN_TEST(test_mix_equals_the_vendors_formula_for_all_inputs);
    RUN_TEST(test_mix_whole_sums_are_exact);
    RUN_TEST(test_mix_mirrors_with_the_turn_and_negates_with_the_input);
    RUN_TEST(test_mix_stays_in_range_for_any_inputs);
    return UNITY_END();
}

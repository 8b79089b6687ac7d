// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/bit.c
#include "fw/bit.h"

#include <string.h>

#include "unity.h"

static struct fw_bit bit;

void setUp(void)
{
    bit = fw_bit_default();
}
void tearDown(void) {}

// Test

static void test_sector_alone_leaves_the_rest(void)
{
    struct fw_bit expected = fw_bit_default();
    expected.sector = FW_SECTOR_RIGHT;
    TEST_ASSERT_TRUE(fw_bit_parse("right", &bit));
    TEST_ASSERT_EQUAL_MEMORY(&expected, &bit, sizeof bit);
}

static void test_numbers_go_where_the_header_says(void)
{
    TEST_ASSERT_TRUE(fw_bit_parse("left,1,2,3,4,5,6,700,8,90", &bit));
    const struct fw_color_box box = {
        .y_min = 1, .y_max = 2, .u_min = 3, .u_max = 4, .v_min = 5, .v_max = 6};
    TEST_ASSERT_EQUAL_MEMORY(&box, &bit.box, sizeof box);
    TEST_ASSERT_EQUAL_INT(FW_SECTOR_LEFT, bit.sector);
    TEST_ASSERT_EQUAL_INT(700, bit.min_blob_px);
    TEST_ASSERT_EQUAL_INT(8, bit.vote.max_frames);
    TEST_ASSERT_EQUAL_INT64(90000, bit.vote.window_us);
    TEST_ASSERT_TRUE(fw_bit_parse("all,0,255,0,255,0,255,0,1,0", &bit));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, bit.vote.window_us);
}

static void test_all_else_is_refused_and_touches_nothing(void)
{
    const struct fw_bit before = bit;
    const char *const bad[] = {"",
                               "lef",
                               "leftt",
                               "left,",
                               "middle",
                               "all,-1",
                               "all,0,256",
                               "all,1,0",
                               "all 1",
                               "all,1.5.1",
                               "all,0,255,0,255,0,255,0,65,0",
                               "all,0,255,0,255,0,255,0,1,0,0"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; ++i)
    {
        TEST_ASSERT_FALSE_MESSAGE(fw_bit_parse(bad[i], &bit), bad[i]);
    }
    TEST_ASSERT_EQUAL_MEMORY(&before, &bit, sizeof bit);
}

// Even ends: two neighbours share U and V.
static void test_halves_meet_and_are_even(void)
{
    struct fw_bit left = bit, right = bit;
    left.sector = FW_SECTOR_LEFT;
    right.sector = FW_SECTOR_RIGHT;
    for (int width_px = 2; width_px <= 1280; width_px += 2)
    {
        int ends_px[6];
        fw_bit_columns(&bit, width_px, ends_px, ends_px + 1);
        fw_bit_columns(&left, width_px, ends_px + 2, ends_px + 3);
        fw_bit_columns(&right, width_px, ends_px + 4, ends_px + 5);
        TEST_ASSERT_EQUAL_INT(0, ends_px[0]);
        TEST_ASSERT_EQUAL_INT(width_px, ends_px[1]);
        TEST_ASSERT_EQUAL_INT(0, ends_px[2]);
        TEST_ASSERT_EQUAL_INT(ends_px[3], ends_px[4]);
        TEST_ASSERT_EQUAL_INT(0, ends_px[3] % 2);
        TEST_ASSERT_INT_WITHIN(1, width_px / 2, ends_px[3]);
        TEST_ASSERT_EQUAL_INT(width_px, ends_px[5]);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_sector_alone_leaves_the_rest);
    RUN_TEST(test_numbers_go_where_the_header_says);
    RUN_TEST(test_all_else_is_refused_and_touches_nothing);
    RUN_TEST(test_halves_meet_and_are_even);
    return UNITY_END();
}

// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/frame.c
#include <limits.h>
#include <string.h>

#include "fw/frame.h"
#include "unity.h"

static const uint8_t bytes[1];
static struct fw_frame frame;

// A 640x480 frame as the camera delivers it: 614,400 bytes.
void setUp(void)
{
    frame = (struct fw_frame){.yuyv = bytes,
                              .width_px = 640,
                              .height_px = 480,
                              .stride_bytes = 1280,
                              .length_bytes = 614400};
}
void tearDown(void) {}

// Test

static void test_whole_frame_passes(void)
{
    TEST_ASSERT_EQUAL_INT(FW_REJECT_NONE, fw_frame_check(&frame, 640, 480));
}

static void test_one_byte_less_is_short(void)
{
    frame.length_bytes = 614399;
    TEST_ASSERT_EQUAL_INT(FW_REJECT_SHORT, fw_frame_check(&frame, 640, 480));
    frame.length_bytes = 0;
    TEST_ASSERT_EQUAL_INT(FW_REJECT_SHORT, fw_frame_check(&frame, 640, 480));
}

static void test_last_row_needs_no_padding(void)
{
    frame.stride_bytes = 1300;
    frame.length_bytes = 479 * 1300 + 1280;
    TEST_ASSERT_EQUAL_INT(FW_REJECT_NONE, fw_frame_check(&frame, 640, 480));
    --frame.length_bytes;
    TEST_ASSERT_EQUAL_INT(FW_REJECT_SHORT, fw_frame_check(&frame, 640, 480));
}

static void test_other_size_is_rejected(void)
{
    TEST_ASSERT_EQUAL_INT(FW_REJECT_SIZE, fw_frame_check(&frame, 320, 480));
    TEST_ASSERT_EQUAL_INT(FW_REJECT_SIZE, fw_frame_check(&frame, 640, 240));
    frame.yuyv = NULL;
    TEST_ASSERT_EQUAL_INT(FW_REJECT_SIZE, fw_frame_check(&frame, 640, 480));
}

static void test_rows_that_overlap_or_run_backward_are_rejected(void)
{
    frame.stride_bytes = 1279;
    TEST_ASSERT_EQUAL_INT(FW_REJECT_SIZE, fw_frame_check(&frame, 640, 480));
    frame.stride_bytes = -1280;
    TEST_ASSERT_EQUAL_INT(FW_REJECT_SIZE, fw_frame_check(&frame, 640, 480));
}

static void test_hugest_stride_is_short_not_overflow(void)
{
    frame.stride_bytes = INT_MAX;
    TEST_ASSERT_EQUAL_INT(FW_REJECT_SHORT, fw_frame_check(&frame, 640, 480));
}

static void test_every_reason_has_its_own_name(void)
{
    for (int a = 0; a <= FW_REJECT_COUNT; ++a)
    {
        for (int b = 0; b < a; ++b)
        {
            TEST_ASSERT_TRUE(
                strcmp(fw_reject_str((enum fw_reject)a), fw_reject_str((enum fw_reject)b)) != 0);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_whole_frame_passes);
    RUN_TEST(test_one_byte_less_is_short);
    RUN_TEST(test_last_row_needs_no_padding);
    RUN_TEST(test_other_size_is_rejected);
    RUN_TEST(test_rows_that_overlap_or_run_backward_are_rejected);
    RUN_TEST(test_hugest_stride_is_short_not_overflow);
    RUN_TEST(test_every_reason_has_its_own_name);
    return UNITY_END();
}

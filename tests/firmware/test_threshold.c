// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/threshold.c
#include <string.h>

#include "fw/threshold.h"
#include "support.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

// Fixture

static bool inside(const struct fw_color_box *box, uint8_t y, uint8_t u, uint8_t v)
{
    return y >= box->y_min && y <= box->y_max && u >= box->u_min && u <= box->u_max &&
           v >= box->v_min && v <= box->v_max;
}

static bool matches(const struct fw_color_box *box, const uint8_t yuv[3])
{
    const uint8_t pair[4] = {yuv[0], yuv[1], yuv[0], yuv[2]};
    const struct fw_threshold threshold = fw_threshold_make(box);
    uint32_t mask;
    return fw_threshold_row(&threshold, pair, 2, &mask);
}

// One row against the definition, pixel by pixel.
static void assert_row(const struct fw_color_box *box, const uint8_t *yuyv, int width_px)
{
    const struct fw_threshold threshold = fw_threshold_make(box);
    uint32_t mask[FW_MASK_WORDS + 1], expected[FW_MASK_WORDS + 1];
    memset(mask, 0xA5, sizeof mask);
    memset(expected, 0xA5, sizeof expected);
    memset(expected, 0, 4 * (size_t)((width_px + 31) / 32));
    bool any = false;
    for (int x = 0; x < width_px; ++x)
    {
        const uint8_t *pair = yuyv + 4 * (x / 2);
        const bool set = inside(box, pair[2 * (x % 2)], pair[1], pair[3]);
        expected[x / 32] |= (uint32_t)set << (x % 32);
        any |= set;
    }
    TEST_ASSERT_EQUAL(any, fw_threshold_row(&threshold, yuyv, width_px, mask));
    TEST_ASSERT_EQUAL_HEX32_ARRAY(expected, mask, FW_MASK_WORDS + 1);
}

// Test

// Limits and bytes are drawn close together, so that equality with a limit is common.
static void test_random_rows_agree_with_the_definition_at_every_width(void)
{
    uint32_t state = 7;
    for (int trial = 0; trial < 20000; ++trial)
    {
        int width_px = 2 * (trial + 1);
        if (width_px > FW_MAX_WIDTH_PX)
        {
            width_px = 2 * (1 + (int)(random_next(&state) % 70));
        }
        uint8_t limits[6];
        const uint8_t base = (uint8_t)(random_next(&state) % 3 * 125);
        for (int i = 0; i < 3; ++i)
        {
            limits[2 * i] = (uint8_t)(base + random_next(&state) % 3);
            limits[2 * i + 1] = (uint8_t)(limits[2 * i] + random_next(&state) % 3);
        }
        const struct fw_color_box box = {limits[0], limits[1], limits[2],
                                         limits[3], limits[4], limits[5]};
        // From the heap and of the exact size, so that a sanitizer sees a read past the row.
        uint8_t *yuyv = malloc(2 * (size_t)width_px);
        TEST_ASSERT_NOT_NULL(yuyv);
        for (int i = 0; i < 2 * width_px; ++i)
        {
            yuyv[i] = (uint8_t)(base + random_next(&state) % 5);
        }
        assert_row(&box, yuyv, width_px);
        free(yuyv);
    }
}

static void test_single_pixel_is_found_at_every_place(void)
{
    const struct fw_color_box box = fw_color_box_green();
    for (int x = 0; x < 640; ++x)
    {
        struct image image = image_make(640, 1, 0);
        image_set(&image, x, 0, kGreen[0], kGreen[1], kGreen[2]);
        // The pixel beside it shares the chroma but is too dark.
        image.yuyv[4 * (x / 2) + 2 * (1 - x % 2)] = 16;
        assert_row(&box, image.yuyv, 640);
        free(image.yuyv);
    }
}

static void test_limits_belong_to_the_box_and_beyond_does_not(void)
{
    const struct fw_color_box box = {50, 60, 70, 80, 90, 100};
    const uint8_t low[3] = {50, 70, 90}, high[3] = {60, 80, 100};
    TEST_ASSERT_TRUE(matches(&box, low));
    TEST_ASSERT_TRUE(matches(&box, high));
    for (int i = 0; i < 3; ++i)
    {
        uint8_t below[3], above[3];
        memcpy(below, low, 3);
        memcpy(above, high, 3);
        --below[i];
        ++above[i];
        TEST_ASSERT_FALSE(matches(&box, below));
        TEST_ASSERT_FALSE(matches(&box, above));
    }
}

static void test_widest_box_takes_every_byte(void)
{
    const struct fw_color_box box = {0, 255, 0, 255, 0, 255};
    const uint8_t black[3] = {0, 0, 0}, white[3] = {255, 255, 255};
    TEST_ASSERT_TRUE(matches(&box, black));
    TEST_ASSERT_TRUE(matches(&box, white));
}

// YUV by the matrix of ITU-R BT.601, studio range.
static void test_default_box_takes_greens_and_leaves_other_colours(void)
{
    const struct fw_color_box box = fw_color_box_green();
    const uint8_t forest[3] = {98, 97, 89}, pale[3] = {159, 105, 99}, pure[3] = {145, 54, 34};
    TEST_ASSERT_TRUE(matches(&box, kGreen));
    TEST_ASSERT_TRUE(matches(&box, forest));
    TEST_ASSERT_TRUE(matches(&box, pale));
    TEST_ASSERT_TRUE(matches(&box, pure));
    const uint8_t red[3] = {81, 90, 240}, blue[3] = {41, 240, 110}, yellow[3] = {210, 16, 146};
    const uint8_t cyan[3] = {170, 166, 16}, magenta[3] = {106, 202, 222}, black[3] = {16, 128, 128};
    TEST_ASSERT_FALSE(matches(&box, red));
    TEST_ASSERT_FALSE(matches(&box, blue));
    TEST_ASSERT_FALSE(matches(&box, yellow));
    TEST_ASSERT_FALSE(matches(&box, cyan));
    TEST_ASSERT_FALSE(matches(&box, magenta));
    TEST_ASSERT_FALSE(matches(&box, black));
    TEST_ASSERT_FALSE(matches(&box, kGrey));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_random_rows_agree_with_the_definition_at_every_width);
    RUN_TEST(test_single_pixel_is_found_at_every_place);
    RUN_TEST(test_limits_belong_to_the_box_and_beyond_does_not);
    RUN_TEST(test_widest_box_takes_every_byte);
    RUN_TEST(test_default_box_takes_greens_and_leaves_other_colours);
    return UNITY_END();
}

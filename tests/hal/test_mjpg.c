// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/hal_linux/mjpg.c. What a colour becomes comes from BT.601: of sRGB (0, 128, 0)
// it is Y 81, U 91, V 81, of (128, 0, 0) Y 49, U 109, V 184.
#include "hal_linux/mjpg.h"

#include <stdbool.h>

#include "jpeg_picture.h"
#include "unity.h"

#define WIDTH_PX 64
#define HEIGHT_PX 48

static const struct jpeg_picture green = {.width_px = WIDTH_PX,
                                          .height_px = HEIGHT_PX,
                                          .rgb = {0, 128, 0},
                                          .horizontal = 2,
                                          .vertical = 1};
static uint8_t yuyv[2 * WIDTH_PX * HEIGHT_PX];
static uint8_t *file;
static size_t length;

void setUp(void)
{
    memset(yuyv, 0, sizeof yuyv);
    length = jpeg_picture_make(&green, &file);
}

void tearDown(void)
{
    free(file);
}

static void make(const struct jpeg_picture *picture)
{
    free(file);
    length = jpeg_picture_make(picture, &file);
}

static enum fw_err decode(void)
{
    return mjpg_to_yuyv(file, length, WIDTH_PX, HEIGHT_PX, yuyv);
}

// Rounding of encoder, decoder and range: one count each.
static void expect_everywhere(int y, int u, int v)
{
    const int expected[4] = {y, u, y, v};
    for (size_t i = 0; i < sizeof yuyv; ++i)
    {
        TEST_ASSERT_INT_WITHIN(2, expected[i % 4], yuyv[i]);
    }
}

// Test

static void test_colours_are_those_of_bt601(void)
{
    TEST_ASSERT_EQUAL(FW_OK, decode());
    expect_everywhere(81, 91, 81);
    struct jpeg_picture red = green;
    red.rgb[0] = 128, red.rgb[1] = 0;
    make(&red);
    TEST_ASSERT_EQUAL(FW_OK, decode());
    expect_everywhere(49, 109, 184);
}

static void test_every_sampling_of_chroma_is_read(void)
{
    static const int samplings[][2] = {{1, 1}, {2, 1}, {2, 2}, {1, 2}, {4, 1}};
    for (size_t i = 0; i < sizeof samplings / sizeof samplings[0]; ++i)
    {
        struct jpeg_picture picture = green;
        picture.horizontal = samplings[i][0], picture.vertical = samplings[i][1];
        make(&picture);
        TEST_ASSERT_EQUAL(FW_OK, decode());
        expect_everywhere(81, 91, 81);
    }
}

static void test_file_without_huffman_tables_is_read_with_the_standards(void)
{
    const size_t whole = length;
    length = jpeg_picture_without(file, length, 0xC4);
    TEST_ASSERT_LESS_THAN(whole, length);
    TEST_ASSERT_EQUAL(FW_OK, decode());
    expect_everywhere(81, 91, 81);
}

static void test_bytes_after_the_picture_are_left_alone(void)
{
    file = realloc(file, length + 512);
    memset(file + length, 0, 512);
    length += 512;
    TEST_ASSERT_EQUAL(FW_OK, decode());
}

static void test_every_shortened_file_is_an_error(void)
{
    // The last two bytes are the end's marker, which some cameras leave out.
    for (size_t whole = length - 2; length > 0; --length)
    {
        const enum fw_err err = decode();
        TEST_ASSERT_TRUE(err != FW_OK || length > whole);
    }
}

static void test_picture_of_another_kind_is_refused(void)
{
    TEST_ASSERT_EQUAL(FW_ERR_FORMAT, mjpg_to_yuyv(file, length, WIDTH_PX, HEIGHT_PX / 2, yuyv));
    TEST_ASSERT_EQUAL(FW_ERR_FORMAT, mjpg_to_yuyv(file, length, WIDTH_PX - 1, HEIGHT_PX, yuyv));
    struct jpeg_picture other = green;
    other.is_progressive = true;
    make(&other);
    TEST_ASSERT_EQUAL(FW_ERR_FORMAT, decode());
    other = green;
    other.is_grey = true;
    make(&other);
    TEST_ASSERT_EQUAL(FW_ERR_FORMAT, decode());
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_colours_are_those_of_bt601);
    RUN_TEST(test_every_sampling_of_chroma_is_read);
    RUN_TEST(test_file_without_huffman_tables_is_read_with_the_standards);
    RUN_TEST(test_bytes_after_the_picture_are_left_alone);
    RUN_TEST(test_every_shortened_file_is_an_error);
    RUN_TEST(test_picture_of_another_kind_is_refused);
    return UNITY_END();
}

// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/blob.c
#include <string.h>

#include "fw/blob.h"
#include "support.h"
#include "unity.h"

#define MAX_W FW_MAX_WIDTH_PX
#define MAX_H 64

static struct fw_blob blob;
static uint8_t picture[MAX_H][MAX_W];
static int stack[MAX_H * MAX_W];

void setUp(void)
{
    memset(picture, 0, sizeof picture);
}
void tearDown(void) {}

// Fixture

static int32_t largest_by_core(int width_px, int height_px)
{
    uint32_t mask[FW_MASK_WORDS];
    fw_blob_begin(&blob);
    for (int y = 0; y < height_px; ++y)
    {
        memset(mask, 0, sizeof mask);
        int count = 0;
        for (int x = 0; x < width_px; ++x)
        {
            mask[x / 32] |= (uint32_t)picture[y][x] << (x % 32);
            count += picture[y][x];
        }
        if (count > 0)
        {
            fw_blob_add_row(&blob, mask, width_px);
        }
        else
        {
            fw_blob_add_empty_row(&blob);
        }
    }
    return blob.largest_px;
}

// Pixels reached from one by steps to the eight neighbours; clears them.
static int32_t flood(int width_px, int height_px, int x, int y)
{
    int32_t area_px = 0;
    int depth = 0;
    stack[depth++] = y * MAX_W + x;
    picture[y][x] = 0;
    while (depth > 0)
    {
        const int at = stack[--depth];
        ++area_px;
        for (int ny = at / MAX_W - 1; ny <= at / MAX_W + 1; ++ny)
        {
            for (int nx = at % MAX_W - 1; nx <= at % MAX_W + 1; ++nx)
            {
                if (nx >= 0 && nx < width_px && ny >= 0 && ny < height_px && picture[ny][nx])
                {
                    picture[ny][nx] = 0;
                    stack[depth++] = ny * MAX_W + nx;
                }
            }
        }
    }
    return area_px;
}

static int32_t largest_by_flood_fill(int width_px, int height_px)
{
    int32_t largest_px = 0;
    for (int y = 0; y < height_px; ++y)
    {
        for (int x = 0; x < width_px; ++x)
        {
            const int32_t area_px = picture[y][x] ? flood(width_px, height_px, x, y) : 0;
            largest_px = area_px > largest_px ? area_px : largest_px;
        }
    }
    return largest_px;
}

static void draw(const char *const *rows, int height_px)
{
    for (int y = 0; y < height_px; ++y)
    {
        for (int x = 0; rows[y][x] != '\0'; ++x)
        {
            picture[y][x] = rows[y][x] == '#';
        }
    }
}

// Test

static void test_empty_picture_has_no_blob(void)
{
    TEST_ASSERT_EQUAL_INT(0, largest_by_core(64, 10));
}

static void test_full_picture_is_one_blob(void)
{
    memset(picture, 1, sizeof picture);
    TEST_ASSERT_EQUAL_INT(MAX_W * MAX_H, largest_by_core(MAX_W, MAX_H));
}

static void test_corner_contact_connects_and_a_gap_does_not(void)
{
    const char *const touching[] = {"##....", "..##..", "....##"};
    draw(touching, 3);
    TEST_ASSERT_EQUAL_INT(6, largest_by_core(6, 3));
    const char *const apart[] = {"##....", "...##.", "##...."};
    draw(apart, 3);
    TEST_ASSERT_EQUAL_INT(2, largest_by_core(6, 3));
}

static void test_empty_row_separates(void)
{
    const char *const rows[] = {"####", "....", "##..", "##.."};
    draw(rows, 4);
    TEST_ASSERT_EQUAL_INT(4, largest_by_core(4, 4));
}

static void test_arms_that_meet_below_count_once(void)
{
    const char *const comb[] = {"#.#.#.#", "#.#.#.#", "#######"};
    draw(comb, 3);
    TEST_ASSERT_EQUAL_INT(15, largest_by_core(7, 3));
    const char *const ring[] = {".###.", "#...#", "#.#.#", "#...#", ".###."};
    draw(ring, 5);
    TEST_ASSERT_EQUAL_INT(12, largest_by_core(5, 5));
}

// Sides that part and meet again and again make the deepest trees of sets.
static void test_random_pictures_agree_with_a_flood_fill(void)
{
    uint32_t state = 1;
    for (int trial = 0; trial < 3000; ++trial)
    {
        const int width_px = 1 + (int)(random_next(&state) % 150);
        const int height_px = 1 + (int)(random_next(&state) % 24);
        const uint32_t share = random_next(&state) % 256;
        for (int y = 0; y < height_px; ++y)
        {
            for (int x = 0; x < width_px; ++x)
            {
                picture[y][x] = (random_next(&state) >> 24) < share;
            }
        }
        const int32_t by_core_px = largest_by_core(width_px, height_px);
        TEST_ASSERT_EQUAL_INT(largest_by_flood_fill(width_px, height_px), by_core_px);
    }
}

// Every second pixel set is the most runs that a row can hold.
static void test_widest_row_of_single_pixels_fits(void)
{
    for (int y = 0; y < MAX_H; ++y)
    {
        for (int x = 0; x < MAX_W; x += 2)
        {
            picture[y][x] = 1;
        }
    }
    TEST_ASSERT_EQUAL_INT(MAX_H, largest_by_core(MAX_W, MAX_H));
}

static void test_checkerboard_is_one_blob(void)
{
    for (int y = 0; y < MAX_H; ++y)
    {
        for (int x = y % 2; x < MAX_W; x += 2)
        {
            picture[y][x] = 1;
        }
    }
    TEST_ASSERT_EQUAL_INT(MAX_W * MAX_H / 2, largest_by_core(MAX_W, MAX_H));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_empty_picture_has_no_blob);
    RUN_TEST(test_full_picture_is_one_blob);
    RUN_TEST(test_corner_contact_connects_and_a_gap_does_not);
    RUN_TEST(test_empty_row_separates);
    RUN_TEST(test_arms_that_meet_below_count_once);
    RUN_TEST(test_random_pictures_agree_with_a_flood_fill);
    RUN_TEST(test_widest_row_of_single_pixels_fits);
    RUN_TEST(test_checkerboard_is_one_blob);
    return UNITY_END();
}

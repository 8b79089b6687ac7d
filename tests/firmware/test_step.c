// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/core/step.c
#include <string.h>

#include "fw/step.h"
#include "support.h"
#include "unity.h"

#define PERIOD_US 33333

static struct fw_ctx ctx;
static struct fw_config config;
static struct fw_output out;
static struct image image;

// A robot that believes every frame, so that one frame tells what it saw.
void setUp(void)
{
    config = fw_config_default();
    config.bits[0].vote.max_frames = 1;
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_init(&ctx, &config));
    image = image_make(640, 480, 0);
}
void tearDown(void)
{
    free(image.yuyv);
}

// Fixture

static struct fw_frame frame_of(const struct image *source, int64_t utime_us, uint32_t seq)
{
    return (struct fw_frame){.yuyv = source->yuyv,
                             .width_px = source->width_px,
                             .height_px = source->height_px,
                             .stride_bytes = source->stride_bytes,
                             .utime_us = utime_us,
                             .seq = seq,
                             .length_bytes = source->length_bytes};
}

static void step_image(int64_t utime_us)
{
    const struct fw_frame frame = frame_of(&image, utime_us, 1);
    fw_step(&ctx, &frame, utime_us, &out);
}

static void assert_duties(int left_pct, int right_pct)
{
    TEST_ASSERT_EQUAL_INT(left_pct, out.wheel_duty_pct[FW_FRONT_LEFT]);
    TEST_ASSERT_EQUAL_INT(right_pct, out.wheel_duty_pct[FW_FRONT_RIGHT]);
    TEST_ASSERT_EQUAL_INT(left_pct, out.wheel_duty_pct[FW_REAR_LEFT]);
    TEST_ASSERT_EQUAL_INT(right_pct, out.wheel_duty_pct[FW_REAR_RIGHT]);
}

static void assert_rejected(const struct fw_frame *frame, int64_t now_us, enum fw_reject reason)
{
    const uint32_t before = ctx.rejected_count[reason];
    fw_step(&ctx, frame, now_us, &out);
    TEST_ASSERT_EQUAL_UINT(before + 1, ctx.rejected_count[reason]);
    TEST_ASSERT_BITS_HIGH(FW_STATUS_FRAME_REJECTED, out.status_flags);
}

// Test

static void test_green_rectangle_is_measured_to_the_pixel(void)
{
    image_fill(&image, 100, 50, 140, 80, kGreen);
    step_image(1000);
    TEST_ASSERT_EQUAL_INT(40 * 30, out.blob_px);
    TEST_ASSERT_EQUAL_INT(1, out.detected_raw);
    TEST_ASSERT_EQUAL_INT(1, out.detected);
    assert_duties(37, 100);
    TEST_ASSERT_EQUAL_INT(100, out.speed_input_pct);
    TEST_ASSERT_EQUAL_INT(500, out.turn_input_milli);
}

static void test_largest_of_two_rectangles_counts(void)
{
    image_fill(&image, 0, 0, 20, 20, kGreen);
    image_fill(&image, 600, 440, 640, 480, kGreen);
    step_image(1000);
    TEST_ASSERT_EQUAL_INT(1600, out.blob_px);
}

static void test_blob_must_exceed_the_threshold(void)
{
    image_fill(&image, 10, 10, 12, 12, kGreen);
    image_fill(&image, 10, 12, 12, 13, kGreen);
    step_image(1000);
    TEST_ASSERT_EQUAL_INT(6, out.blob_px);
    TEST_ASSERT_EQUAL_INT(0, out.detected_raw);
    image_fill(&image, 200, 200, 230, 210, kGreen);
    step_image(2000);
    TEST_ASSERT_EQUAL_INT(300, out.blob_px);
    TEST_ASSERT_EQUAL_INT(0, out.detected_raw);
    // One pixel more, of a pair whose other pixel is too dark.
    image_set(&image, 230, 205, kGreen[0], kGreen[1], kGreen[2]);
    image_set(&image, 231, 205, 16, kGreen[1], kGreen[2]);
    step_image(3000);
    TEST_ASSERT_EQUAL_INT(301, out.blob_px);
    TEST_ASSERT_EQUAL_INT(1, out.detected_raw);
}

static void test_grey_frame_is_unseen(void)
{
    step_image(1000);
    TEST_ASSERT_EQUAL_INT(0, out.blob_px);
    TEST_ASSERT_EQUAL_INT(FW_MODE_TABLE, out.mode);
    assert_duties(100, 37);
}

static void test_green_padding_between_rows_is_not_seen(void)
{
    free(image.yuyv);
    image = image_make(640, 480, 64);
    step_image(1000);
    TEST_ASSERT_EQUAL_INT(0, out.blob_px);
    image_fill(&image, 620, 100, 640, 120, kGreen);
    step_image(2000);
    TEST_ASSERT_EQUAL_INT(400, out.blob_px);
}

static void test_bad_frames_are_counted_and_change_nothing(void)
{
    step_image(1000);
    image_fill(&image, 0, 0, 640, 480, kGreen);
    struct fw_frame frame = frame_of(&image, 2000, 2);
    --frame.length_bytes;
    assert_rejected(&frame, 2000, FW_REJECT_SHORT);
    frame = frame_of(&image, 2000, 2);
    frame.width_px = 320;
    assert_rejected(&frame, 2000, FW_REJECT_SIZE);
    frame = frame_of(&image, 2001, 2);
    assert_rejected(&frame, 2000, FW_REJECT_FUTURE);
    frame = frame_of(&image, 1000, 2);
    assert_rejected(&frame, 2000, FW_REJECT_REPEATED);
    TEST_ASSERT_EQUAL_INT(0, out.detected);
    TEST_ASSERT_EQUAL_UINT(1, out.frame_seq);
    TEST_ASSERT_EQUAL_INT64(1000, out.frame_utime_us);
    assert_duties(100, 37);
}

static void test_frame_older_than_the_timeout_never_drives(void)
{
    const struct fw_frame frame = frame_of(&image, 0, 1);
    assert_rejected(&frame, 200001, FW_REJECT_STALE);
    TEST_ASSERT_EQUAL_INT(FW_MODE_FAULT, out.mode);
    assert_duties(0, 0);
}

static void test_motors_stop_one_microsecond_past_the_timeout(void)
{
    step_image(1000);
    fw_step(&ctx, NULL, 201000, &out);
    assert_duties(100, 37);
    TEST_ASSERT_EQUAL_INT(0, out.status_flags);
    fw_step(&ctx, NULL, 201001, &out);
    assert_duties(0, 0);
    TEST_ASSERT_EQUAL_INT(FW_MODE_FAULT, out.mode);
    TEST_ASSERT_BITS_HIGH(FW_STATUS_FRAME_STALE, out.status_flags);
    TEST_ASSERT_EQUAL_INT64(0, out.frame_utime_us);
    step_image(300000);
    assert_duties(100, 37);
}

static void test_motors_stand_still_before_the_first_frame(void)
{
    fw_step(&ctx, NULL, 1000, &out);
    assert_duties(0, 0);
    TEST_ASSERT_EQUAL_INT(FW_MODE_FAULT, out.mode);
    TEST_ASSERT_EQUAL_INT64(0, out.frame_utime_us);
}

static void test_clock_that_steps_back_stops_and_recovers_with_the_next_frame(void)
{
    step_image(1000000);
    fw_step(&ctx, NULL, 500, &out);
    assert_duties(0, 0);
    step_image(600);
    assert_duties(100, 37);
}

static void test_votes_from_before_a_gap_do_not_count(void)
{
    config.bits[0].vote.max_frames = 10;
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_init(&ctx, &config));
    for (int i = 1; i <= 10; ++i)
    {
        fw_step_bits(&ctx, true, i * PERIOD_US, (uint32_t)i, i * PERIOD_US, &out);
    }
    TEST_ASSERT_EQUAL_INT(1, out.detected);
    fw_step_bits(&ctx, false, 20 * PERIOD_US, 20, 20 * PERIOD_US, &out);
    TEST_ASSERT_EQUAL_INT(0, out.detected);
}

// The same bits as pixels and bare, with frames missing at random: all but blob_px is equal.
static void test_bit_and_pixels_take_the_same_decisions(void)
{
    static struct fw_ctx bare;
    config = fw_config_default();
    config.frame_timeout_us = 3 * PERIOD_US;
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_init(&ctx, &config));
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_init(&bare, &config));
    struct image green = image_make(640, 480, 0);
    image_fill(&green, 300, 200, 340, 240, kGreen);
    uint32_t state = 5;
    for (int i = 1; i <= 300; ++i)
    {
        const int64_t now_us = (int64_t)i * PERIOD_US;
        const bool seen = random_next(&state) % 2;
        const struct fw_frame frame = frame_of(seen ? &green : &image, now_us - 100, (uint32_t)i);
        const bool missing = random_next(&state) % 2;
        struct fw_output bare_out;
        fw_step(&ctx, missing ? NULL : &frame, now_us, &out);
        if (missing)
        {
            fw_step(&bare, NULL, now_us, &bare_out);
        }
        else
        {
            fw_step_bits(&bare, seen, now_us - 100, (uint32_t)i, now_us, &bare_out);
        }
        TEST_ASSERT_EQUAL_INT(out.detected_raw ? 1600 : 0, out.blob_px);
        out.blob_px = bare_out.blob_px;
        TEST_ASSERT_EQUAL_MEMORY(&bare_out, &out, sizeof out);
    }
    free(green.yuyv);
}

static void test_robots_in_one_process_do_not_influence_each_other(void)
{
    static struct fw_ctx together[2], alone[2];
    struct fw_config configs[2] = {fw_config_default(), fw_config_default()};
    configs[1].table = (struct fw_table){1, {{-50, 0}, {0, -2000}}};
    configs[1].bits[0].vote.max_frames = 3;
    uint8_t bit[200];
    uint32_t state = 9;
    struct fw_output expected[2][200];
    for (int r = 0; r < 2; ++r)
    {
        TEST_ASSERT_EQUAL_INT(FW_OK, fw_init(&together[r], &configs[r]));
        TEST_ASSERT_EQUAL_INT(FW_OK, fw_init(&alone[r], &configs[r]));
    }
    for (int i = 0; i < 200; ++i)
    {
        bit[i] = random_next(&state) % 4;
    }
    for (int r = 0; r < 2; ++r)
    {
        for (int i = 0; i < 200; ++i)
        {
            fw_step_bits(&alone[r], bit[i] >> r & 1, i, (uint32_t)i, i, &expected[r][i]);
        }
    }
    for (int i = 0; i < 200; ++i)
    {
        for (int r = 0; r < 2; ++r)
        {
            fw_step_bits(&together[r], bit[i] >> r & 1, i, (uint32_t)i, i, &out);
            TEST_ASSERT_EQUAL_MEMORY(&expected[r][i], &out, sizeof out);
        }
    }
}

static void test_cap_limits_duties_but_not_the_inputs_told(void)
{
    config.duty_cap_pct = 50;
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_init(&ctx, &config));
    step_image(1000);
    assert_duties(50, 37);
    TEST_ASSERT_EQUAL_INT(100, out.speed_input_pct);
    TEST_ASSERT_BITS_HIGH(FW_STATUS_SPEED_CAPPED, out.status_flags);
}

static void test_robot_that_is_not_running_looks_but_does_not_move(void)
{
    fw_set_running(&ctx, false);
    image_fill(&image, 100, 50, 140, 80, kGreen);
    step_image(1000);
    TEST_ASSERT_EQUAL_INT(FW_MODE_STOPPED, out.mode);
    TEST_ASSERT_EQUAL_INT(1, out.detected);
    assert_duties(0, 0);
    const struct fw_input input = {100, 0};
    fw_step_script_input(&ctx, &input, &out);
    assert_duties(0, 0);
    fw_set_running(&ctx, true);
    fw_step(&ctx, NULL, 1001, &out);
    assert_duties(37, 100);
}

static void test_script_needs_no_frames_and_is_capped(void)
{
    config.duty_cap_pct = 60;
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_init(&ctx, &config));
    const struct fw_input input = {100, -500};
    fw_step_script_input(&ctx, &input, &out);
    assert_duties(60, 37);
    TEST_ASSERT_EQUAL_INT(FW_MODE_SCRIPT, out.mode);
    TEST_ASSERT_EQUAL_INT(-500, out.turn_input_milli);
    const int8_t duty_pct[FW_WHEEL_COUNT] = {10, -20, 61, -128};
    const int8_t capped_pct[FW_WHEEL_COUNT] = {10, -20, 60, -60};
    fw_step_script_duty(&ctx, duty_pct, &out);
    TEST_ASSERT_EQUAL_INT8_ARRAY(capped_pct, out.wheel_duty_pct, FW_WHEEL_COUNT);
    TEST_ASSERT_BITS_HIGH(FW_STATUS_SPEED_CAPPED, out.status_flags);
    TEST_ASSERT_EQUAL_INT(1, out.seq);
}

static void test_new_table_acts_at_once_and_a_bad_one_not_at_all(void)
{
    step_image(1000);
    const struct fw_table table = {1, {{-50, 0}, {0, 0}}};
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_set_table(&ctx, &table));
    const struct fw_table bad = {1, {{0, 0}, {0, 2001}}};
    TEST_ASSERT_EQUAL_INT(FW_ERR_INPUT_RANGE, fw_set_table(&ctx, &bad));
    fw_step(&ctx, NULL, 1001, &out);
    assert_duties(-50, -50);
}

static void test_init_leaves_the_robot_untouched_on_a_bad_config(void)
{
    struct fw_ctx before = ctx;
    config.duty_cap_pct = 101;
    TEST_ASSERT_EQUAL_INT(FW_ERR_DUTY_CAP, fw_init(&ctx, &config));
    TEST_ASSERT_EQUAL_MEMORY(&before, &ctx, sizeof ctx);
    TEST_ASSERT_TRUE(sizeof ctx < 100 * 1024);
}

// The row of each number of k bits, and what the mixing makes of it by hand: left is speed - 126
// turn, right is speed + 126 turn.
static void test_bits_choose_their_row(void)
{
    for (uint8_t k = 1; k <= FW_MAX_BITS; ++k)
    {
        config.bit_count = k;
        config.table.bit_count = k;
        for (int row = 0; row < 1 << k; ++row)
        {
            config.table.rows[row] = (struct fw_input){(int16_t)(row - 8), 0};
        }
        for (int i = 0; i < k; ++i)
        {
            config.bits[i] = config.bits[0];
        }
        TEST_ASSERT_EQUAL_INT(FW_OK, fw_init(&ctx, &config));
        for (int row = 0; row < 1 << k; ++row)
        {
            fw_step_bits(&ctx, (uint32_t)row, 1000 * (row + 1), 0, 1000 * (row + 1), &out);
            TEST_ASSERT_EQUAL_INT(row, out.detected_raw);
            TEST_ASSERT_EQUAL_INT(row, out.detected);
            assert_duties(row - 8, row - 8);
        }
    }
}

static void set_bits(int count, const char *const texts[])
{
    config.bit_count = count;
    for (int i = 0; i < count; ++i)
    {
        config.bits[i] = config.bits[0];
        TEST_ASSERT_TRUE_MESSAGE(fw_bit_parse(texts[i], &config.bits[i]), texts[i]);
    }
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_init(&ctx, &config));
}

// sRGB (200, 30, 30) in BT.601 studio range, from the standard's matrix.
static const uint8_t kRed[3] = {82, 102, 203};

static void test_bits_look_for_their_colour_in_their_sector(void)
{
    static const char *const texts[] = {"left", "right", "all,40,235,0,124,165,255",
                                        "left,40,235,0,124,165,255"};
    static const struct
    {
        int begin_px;
        const uint8_t *colour;
        int bits;
    } cases[] = {{100, kGreen, 1}, {300, kGreen, 3}, {310, kGreen, 2},
                 {500, kGreen, 2}, {100, kRed, 12},  {500, kRed, 4}};
    set_bits(4, texts);
    for (int i = 0; i < (int)(sizeof cases / sizeof cases[0]); ++i)
    {
        // 40 px wide: from 300 on, 20 lie left of the middle, from 310 on, 10 do: 300 px are not
        // more than 300.
        image_fill(&image, 0, 0, 640, 480, kGrey);
        image_fill(&image, cases[i].begin_px, 100, cases[i].begin_px + 40, 130, cases[i].colour);
        step_image(1000 * (i + 1));
        TEST_ASSERT_EQUAL_INT(cases[i].bits, out.detected_raw);
    }
}

// Each bit of several says of any picture what a robot with that bit alone says.
static void test_several_bits_are_what_each_is_alone(void)
{
    static const char *const texts[] = {"left,0,255,0,90,0,120,40", "all,0,255,100,170,100,170,1",
                                        "right,0,255,130,255,0,128,10", "all,60,70,0,255,0,255,2"};
    uint32_t state = 5;
    for (int round = 0; round < 40; ++round)
    {
        config.width_px = 2 + 2 * (int)(random_next(&state) % 60);
        config.height_px = 1 + (int)(random_next(&state) % 20);
        free(image.yuyv);
        image = image_make(config.width_px, config.height_px, 0);
        const uint32_t coarse = random_next(&state) % 2 ? 0xFF : 0xC0;
        for (size_t i = 0; i < image.length_bytes; ++i)
        {
            image.yuyv[i] = (uint8_t)(random_next(&state) & coarse);
        }
        set_bits(4, texts);
        step_image(1000);
        const int together = out.detected_raw;
        int apart = 0;
        for (int i = 0; i < 4; ++i)
        {
            set_bits(1, texts + i);
            step_image(1000);
            apart |= out.detected_raw << i;
        }
        TEST_ASSERT_EQUAL_INT(apart, together);
    }
}

static void test_each_bit_has_its_own_vote(void)
{
    static const char *const texts[] = {"all,0,255,0,255,0,255,0,1", "all,0,255,0,255,0,255,0,3"};
    static const int votes[] = {3, 3, 0 + 2, 0, 0};
    set_bits(2, texts);
    for (int i = 0; i < 5; ++i)
    {
        // Two frames with both, then none: 2 of 2, 2 of 2, 2 of 3, 1 of 3.
        fw_step_bits(&ctx, i < 2 ? 3 : 0, i + 1, 0, i + 1, &out);
        TEST_ASSERT_EQUAL_INT(votes[i], out.detected);
    }
}

static void test_table_of_more_bits_than_configured_is_refused(void)
{
    struct fw_table table = {.bit_count = 2};
    TEST_ASSERT_EQUAL_INT(FW_ERR_BITS, fw_set_table(&ctx, &table));
    config.table = table;
    TEST_ASSERT_EQUAL_INT(FW_ERR_BITS, fw_init(&ctx, &config));
    config.bit_count = 2;
    config.bits[1] = config.bits[0];
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_init(&ctx, &config));
    TEST_ASSERT_EQUAL_INT(FW_OK, fw_set_table(&ctx, &table));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_green_rectangle_is_measured_to_the_pixel);
    RUN_TEST(test_largest_of_two_rectangles_counts);
    RUN_TEST(test_blob_must_exceed_the_threshold);
    RUN_TEST(test_grey_frame_is_unseen);
    RUN_TEST(test_green_padding_between_rows_is_not_seen);
    RUN_TEST(test_bad_frames_are_counted_and_change_nothing);
    RUN_TEST(test_frame_older_than_the_timeout_never_drives);
    RUN_TEST(test_motors_stop_one_microsecond_past_the_timeout);
    RUN_TEST(test_motors_stand_still_before_the_first_frame);
    RUN_TEST(test_clock_that_steps_back_stops_and_recovers_with_the_next_frame);
    RUN_TEST(test_votes_from_before_a_gap_do_not_count);
    RUN_TEST(test_bit_and_pixels_take_the_same_decisions);
    RUN_TEST(test_robots_in_one_process_do_not_influence_each_other);
    RUN_TEST(test_cap_limits_duties_but_not_the_inputs_told);
    RUN_TEST(test_robot_that_is_not_running_looks_but_does_not_move);
    RUN_TEST(test_script_needs_no_frames_and_is_capped);
    RUN_TEST(test_new_table_acts_at_once_and_a_bad_one_not_at_all);
    RUN_TEST(test_init_leaves_the_robot_untouched_on_a_bad_config);
    RUN_TEST(test_bits_choose_their_row);
    RUN_TEST(test_bits_look_for_their_colour_in_their_sector);
    RUN_TEST(test_several_bits_are_what_each_is_alone);
    RUN_TEST(test_each_bit_has_its_own_vote);
    RUN_TEST(test_table_of_more_bits_than_configured_is_refused);
    return UNITY_END();
}

// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/hal_linux/camera_v4l2.c and camera_v4l2_setup.c
#include "hal_linux/camera_v4l2.h"

#include "fake_v4l2.h"
#include "hal_stub/stub_clock.h"
#include "jpeg_picture.h"
#include "unity.h"

// Fixture

#define FRAME_BYTES (2 * 640 * 480)
#define MONOTONIC V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC

static struct stub_clock hand;
static struct hal_clock hand_clock;
static struct camera_v4l2 driver;
static struct hal_camera camera;
static struct hal_camera_format format;

static void make_camera(const char *path, int width_px, int height_px)
{
    const struct camera_v4l2_config config = {
        .path = path, .width_px = width_px, .height_px = height_px, .rate_Hz = 30};
    camera = camera_v4l2_make(&driver, &config, &hand_clock, &fake_sys);
}

void setUp(void)
{
    fake_reset();
    hand = (struct stub_clock){.monotonic_us = 5000000};
    hand_clock = stub_clock_make(&hand);
    make_camera("/dev/camera", 640, 480);
}

void tearDown(void)
{
    hal_camera_close(&camera);
    // Whatever a test did: nothing stays open, mapped or streaming.
    TEST_ASSERT_EQUAL(0, fake.open_count);
    TEST_ASSERT_EQUAL(0, fake.mapped_count);
    TEST_ASSERT_FALSE(fake.streaming && fake.fails_at == 0);
}

static void open_camera(void)
{
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_open(&camera, &format));
}

static struct hal_camera_stats stats(void)
{
    struct hal_camera_stats now;
    hal_camera_stats(&camera, &now);
    return now;
}

// Test

static void test_open_streams_the_size_asked_for_and_locks_colour(void)
{
    open_camera();
    TEST_ASSERT_EQUAL(640, format.width_px);
    TEST_ASSERT_EQUAL(480, format.height_px);
    TEST_ASSERT_TRUE(fake.streaming);
    TEST_ASSERT_EQUAL(FAKE_BUFFERS, fake.fifo_count);
    TEST_ASSERT_TRUE(fake.exposure_is_manual);
    TEST_ASSERT_TRUE(fake.white_balance_is_locked);
    TEST_ASSERT_EQUAL(FAKE_FD, hal_camera_fd(&camera));
}

static void test_camera_without_controls_is_used_as_it_is(void)
{
    fake.has_controls = false;
    open_camera();
    TEST_ASSERT_TRUE(fake.streaming);
}

static void test_nearest_size_that_the_core_can_read_is_chosen(void)
{
    make_camera("/dev/camera", 320, 240);
    open_camera();
    TEST_ASSERT_EQUAL(320, format.width_px);
    TEST_ASSERT_EQUAL(180, format.height_px);
    hal_camera_close(&camera);
    // 1920x1080 would be nearer.
    make_camera("/dev/camera", 1280, 1024);
    open_camera();
    TEST_ASSERT_EQUAL(640, format.width_px);
}

static void test_padding_of_rows_reaches_the_frame(void)
{
    fake.padding_bytes = 32;
    open_camera();
    fake_arrive(0, MONOTONIC, 1312 * 480, 4990000);
    struct fw_frame frame;
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL(1280 + 32, frame.stride_bytes);
    TEST_ASSERT_EQUAL(FW_REJECT_NONE, fw_frame_check(&frame, 640, 480));
}

static void test_camera_without_yuyv_is_refused(void)
{
    fake.formats[0] = V4L2_PIX_FMT_H264;
    fake.format_count = 1;
    TEST_ASSERT_EQUAL(FW_ERR_FORMAT, hal_camera_open(&camera, &format));
}

static void test_absent_camera_is_no_device(void)
{
    make_camera("/dev/other", 640, 480);
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_camera_open(&camera, &format));
    TEST_ASSERT_EQUAL(-1, hal_camera_fd(&camera));
}

static void test_frame_has_the_drivers_time_number_and_bytes(void)
{
    open_camera();
    fake_arrive(7, MONOTONIC, FRAME_BYTES, 4987654);
    struct fw_frame frame;
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL_PTR(fake.memory[0], frame.yuyv);
    TEST_ASSERT_EQUAL_INT64(4987654, frame.utime_us);
    TEST_ASSERT_EQUAL(7, frame.seq);
    TEST_ASSERT_EQUAL(FRAME_BYTES, frame.length_bytes);
    TEST_ASSERT_EQUAL(FW_ERR_TIMEOUT, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL(1, stats().taken_count);
}

static void test_time_of_another_clock_is_replaced_by_the_arrival(void)
{
    open_camera();
    fake_arrive(0, V4L2_BUF_FLAG_TIMESTAMP_COPY, FRAME_BYTES, 123);
    struct fw_frame frame;
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL_INT64(5000000, frame.utime_us);
}

static void test_time_that_is_none_is_replaced_by_the_arrival(void)
{
    static const int64_t no_times_us[] = {-1, INT64_MIN, INT64_MAX};
    open_camera();
    for (size_t i = 0; i < sizeof no_times_us / sizeof no_times_us[0]; ++i)
    {
        fake_arrive((uint32_t)i, MONOTONIC, FRAME_BYTES, no_times_us[i]);
        struct fw_frame frame;
        TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
        TEST_ASSERT_EQUAL_INT64(5000000, frame.utime_us);
    }
}

// The kernel's own test camera does so, by up to half a frame period.
static void test_time_that_runs_ahead_is_replaced_by_the_arrival(void)
{
    open_camera();
    fake_arrive(0, MONOTONIC, FRAME_BYTES, 5016000);
    struct fw_frame frame;
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL_INT64(5000000, frame.utime_us);
}

static void test_half_a_frame_says_how_long_it_is(void)
{
    open_camera();
    fake_arrive(0, MONOTONIC, FRAME_BYTES / 2, 4990000);
    struct fw_frame frame;
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL(FW_REJECT_SHORT, fw_frame_check(&frame, 640, 480));
}

static void test_newest_of_several_is_taken_and_the_others_are_dropped(void)
{
    open_camera();
    fake_arrive(0, MONOTONIC, FRAME_BYTES, 4900000);
    fake_arrive(1, MONOTONIC, FRAME_BYTES, 4933333);
    fake_arrive(2, MONOTONIC, FRAME_BYTES, 4966666);
    struct fw_frame frame;
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL(2, frame.seq);
    TEST_ASSERT_EQUAL(2, stats().dropped_count);
    // All but the one that is held are back with the driver.
    TEST_ASSERT_EQUAL(FAKE_BUFFERS - 1, fake.fifo_count);
}

static void test_gap_in_the_numbers_counts_as_dropped(void)
{
    open_camera();
    struct fw_frame frame;
    fake_arrive(10, MONOTONIC, FRAME_BYTES, 4900000);
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
    fake_arrive(14, MONOTONIC, FRAME_BYTES, 4990000);
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL(3, stats().dropped_count);
}

static void test_damaged_frame_is_given_back_and_counted(void)
{
    open_camera();
    fake_arrive(0, MONOTONIC | V4L2_BUF_FLAG_ERROR, FRAME_BYTES, 4900000);
    struct fw_frame frame;
    TEST_ASSERT_EQUAL(FW_ERR_TIMEOUT, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL(1, stats().damaged_count);
    TEST_ASSERT_EQUAL(FAKE_BUFFERS, fake.fifo_count);
    fake_arrive(1, MONOTONIC, FRAME_BYTES, 4933333);
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL(1, frame.seq);
}

static void test_unplugged_camera_comes_back_after_closing(void)
{
    open_camera();
    struct fw_frame frame;
    fake_arrive(3, MONOTONIC, FRAME_BYTES, 4900000);
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
    fake.fails_at = fake.call_count + 1;
    fake.fails_errno = ENODEV;
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_camera_take(&camera, &frame));
    hal_camera_close(&camera);
    TEST_ASSERT_EQUAL(0, fake.mapped_count);
    // A new device, whose numbers begin at 0: no gap.
    fake_reset();
    open_camera();
    fake_arrive(0, MONOTONIC, FRAME_BYTES, 4990000);
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL(0, stats().dropped_count);
    TEST_ASSERT_EQUAL(2, stats().taken_count);
}

// Every call to the driver fails in turn: an error comes back or the call did not matter (a
// control), and all is closed.
static void test_open_that_fails_anywhere_leaves_nothing_behind(void)
{
    open_camera();
    const int calls = fake.call_count;
    hal_camera_close(&camera);
    TEST_ASSERT_GREATER_THAN(10, calls);
    for (int fails_at = 1; fails_at <= calls; ++fails_at)
    {
        fake_reset();
        fake.fails_at = fails_at;
        fake.fails_errno = ENODEV;
        TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_camera_open(&camera, &format));
        TEST_ASSERT_EQUAL(0, fake.open_count);
        TEST_ASSERT_EQUAL(0, fake.mapped_count);
    }
}

// A camera that has Motion-JPEG alone; buffer 0 holds a green picture. @return its length in bytes.
static uint32_t have_mjpg_alone(void)
{
    const struct jpeg_picture green = {
        .width_px = 640, .height_px = 480, .rgb = {0, 128, 0}, .horizontal = 2, .vertical = 1};
    uint8_t *file;
    const size_t length = jpeg_picture_make(&green, &file);
    memcpy(fake.memory[0], file, length);
    free(file);
    fake.format_count = 1;
    return (uint32_t)length;
}

static void test_camera_that_has_motion_jpeg_alone_is_decoded(void)
{
    const uint32_t length = have_mjpg_alone();
    open_camera();
    fake_arrive(1, MONOTONIC, length, 4000000);
    struct fw_frame frame;
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL(FW_REJECT_NONE, fw_frame_check(&frame, 640, 480));
    TEST_ASSERT_EQUAL(FRAME_BYTES, frame.length_bytes);
    TEST_ASSERT_EQUAL(4000000, frame.utime_us);
    // sRGB (0, 128, 0) in BT.601.
    TEST_ASSERT_INT_WITHIN(2, 81, frame.yuyv[0]);
    TEST_ASSERT_INT_WITHIN(2, 91, frame.yuyv[1]);
    TEST_ASSERT_INT_WITHIN(2, 81, frame.yuyv[FRAME_BYTES - 1]);
}

static void test_damaged_motion_jpeg_is_counted_and_is_no_frame(void)
{
    const uint32_t length = have_mjpg_alone();
    open_camera();
    fake_arrive(1, MONOTONIC, length / 2, 4000000);
    struct fw_frame frame;
    TEST_ASSERT_EQUAL(FW_ERR_TIMEOUT, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL(1, stats().damaged_count);
    TEST_ASSERT_EQUAL(0, stats().taken_count);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_open_streams_the_size_asked_for_and_locks_colour);
    RUN_TEST(test_camera_without_controls_is_used_as_it_is);
    RUN_TEST(test_nearest_size_that_the_core_can_read_is_chosen);
    RUN_TEST(test_padding_of_rows_reaches_the_frame);
    RUN_TEST(test_camera_without_yuyv_is_refused);
    RUN_TEST(test_absent_camera_is_no_device);
    RUN_TEST(test_frame_has_the_drivers_time_number_and_bytes);
    RUN_TEST(test_time_of_another_clock_is_replaced_by_the_arrival);
    RUN_TEST(test_time_that_is_none_is_replaced_by_the_arrival);
    RUN_TEST(test_time_that_runs_ahead_is_replaced_by_the_arrival);
    RUN_TEST(test_half_a_frame_says_how_long_it_is);
    RUN_TEST(test_newest_of_several_is_taken_and_the_others_are_dropped);
    RUN_TEST(test_gap_in_the_numbers_counts_as_dropped);
    RUN_TEST(test_damaged_frame_is_given_back_and_counted);
    RUN_TEST(test_unplugged_camera_comes_back_after_closing);
    RUN_TEST(test_open_that_fails_anywhere_leaves_nothing_behind);
    RUN_TEST(test_camera_that_has_motion_jpeg_alone_is_decoded);
    RUN_TEST(test_damaged_motion_jpeg_is_counted_and_is_no_frame);
    return UNITY_END();
}

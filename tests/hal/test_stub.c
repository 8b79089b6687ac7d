// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/hal_stub
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "hal_linux/clock_linux.h"
#include "hal_stub/stub_board.h"
#include "hal_stub/stub_camera.h"
#include "hal_stub/stub_clock.h"
#include "unity.h"

// Fixture

#define FRAME_BYTES (2 * 4 * 2)

static char folder[] = "/tmp/test_stub.XXXXXX";
static char path[64];
static struct stub_clock hand;
static struct hal_clock hand_clock;
static struct stub_camera driver;
static const struct stub_camera_config config = {.path = path, .width_px = 4, .height_px = 2};
static struct hal_camera_format format;

void setUp(void)
{
    hand = (struct stub_clock){.monotonic_us = 1000};
    hand_clock = stub_clock_make(&hand);
}

void tearDown(void)
{
    unlink(path);
}

static void write_frames(size_t bytes)
{
    FILE *file = fopen(path, "wb");
    TEST_ASSERT_NOT_NULL(file);
    for (size_t i = 0; i < bytes; ++i)
    {
        fputc((int)i, file);
    }
    fclose(file);
}

// Test

static void test_file_is_played_frame_by_frame_to_its_end(void)
{
    write_frames(2 * FRAME_BYTES);
    const struct hal_camera camera = stub_camera_file(&driver, &config, &hand_clock, NULL);
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_open(&camera, &format));
    struct fw_frame frame;
    for (uint32_t seq = 0; seq < 2; ++seq)
    {
        hand.monotonic_us += 33333;
        TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
        TEST_ASSERT_EQUAL(seq, frame.seq);
        TEST_ASSERT_EQUAL(seq * FRAME_BYTES, frame.yuyv[0]);
        TEST_ASSERT_EQUAL_INT64(hand.monotonic_us, frame.utime_us);
        TEST_ASSERT_EQUAL(FW_REJECT_NONE, fw_frame_check(&frame, 4, 2));
    }
    TEST_ASSERT_EQUAL(FW_ERR_END, hal_camera_take(&camera, &frame));
    hal_camera_close(&camera);
}

static void test_file_of_no_whole_frames_is_refused(void)
{
    const struct hal_camera camera = stub_camera_file(&driver, &config, &hand_clock, NULL);
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_camera_open(&camera, &format));
    write_frames(FRAME_BYTES + 1);
    TEST_ASSERT_EQUAL(FW_ERR_FORMAT, hal_camera_open(&camera, &format));
    write_frames(0);
    TEST_ASSERT_EQUAL(FW_ERR_FORMAT, hal_camera_open(&camera, &format));
}

static void test_paced_file_gives_a_frame_when_its_descriptor_says_so(void)
{
    write_frames(2 * FRAME_BYTES);
    struct stub_camera_config paced = config;
    paced.rate_Hz = 50;
    const struct hal_clock clock = clock_linux();
    const struct hal_camera camera = stub_camera_file(&driver, &paced, &clock, NULL);
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_open(&camera, &format));
    const int64_t begin_us = hal_clock_monotonic_us(&clock);
    struct fw_frame frame;
    const int fd = hal_camera_fd(&camera);
    do
    {
        hal_clock_wait(&clock, &fd, 1, 1000000);
    } while (hal_camera_take(&camera, &frame) == FW_ERR_TIMEOUT);
    TEST_ASSERT_GREATER_OR_EQUAL_INT64(20000, hal_clock_monotonic_us(&clock) - begin_us);
    hal_camera_close(&camera);
}

static void test_socket_gives_whole_frames_and_ends_when_the_sender_does(void)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    strcpy(address.sun_path, path);
    const int listener = socket(AF_UNIX, SOCK_STREAM, 0);
    TEST_ASSERT_EQUAL(0, bind(listener, (struct sockaddr *)&address, sizeof address));
    TEST_ASSERT_EQUAL(0, listen(listener, 1));
    const struct hal_camera camera = stub_camera_socket(&driver, &config, &hand_clock, NULL);
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_open(&camera, &format));
    const int sender = accept(listener, NULL, NULL);

    uint8_t bytes[FRAME_BYTES];
    memset(bytes, 7, sizeof bytes);
    struct fw_frame frame;
    TEST_ASSERT_EQUAL(10, write(sender, bytes, 10));
    TEST_ASSERT_EQUAL(FW_ERR_TIMEOUT, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL(FRAME_BYTES - 10, write(sender, bytes, FRAME_BYTES - 10));
    TEST_ASSERT_EQUAL(FW_OK, hal_camera_take(&camera, &frame));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(bytes, frame.yuyv, FRAME_BYTES);
    close(sender);
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_camera_take(&camera, &frame));
    hal_camera_close(&camera);
    close(listener);
    TEST_ASSERT_EQUAL(FW_ERR_NO_DEVICE, hal_camera_open(&camera, &format));
}

static void test_board_keeps_and_records_the_last_duties(void)
{
    struct stub_board board = {.record_path = path, .clock = hand_clock};
    const struct hal_motors motors = stub_board_motors(&board);
    const int8_t duties_pct[FW_WHEEL_COUNT] = {1, -2, 3, 100};
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_write(&motors, duties_pct));
    TEST_ASSERT_EQUAL_INT8_ARRAY(duties_pct, board.wheel_duty_pct, FW_WHEEL_COUNT);
    hand.monotonic_us = 2000;
    TEST_ASSERT_EQUAL(FW_OK, hal_motors_stop(&motors));
    char text[64] = "";
    FILE *file = fopen(path, "r");
    TEST_ASSERT_EQUAL(1, fread(text, 30, 1, file) == 0);
    fclose(file);
    TEST_ASSERT_EQUAL_STRING("1000,1,-2,3,100\n2000,0,0,0,0\n", text);
}

static void test_exactly_the_chosen_calls_fail(void)
{
    struct stub_faults faults = {.fails_at = 3, .fails_count = 2, .err = FW_ERR_IO};
    struct stub_board board = {.faults = &faults, .clock = hand_clock};
    const struct hal_motors motors = stub_board_motors(&board);
    for (int call = 1; call <= 6; ++call)
    {
        TEST_ASSERT_EQUAL(call == 3 || call == 4 ? FW_ERR_IO : FW_OK, hal_motors_stop(&motors));
    }
}

int main(void)
{
    TEST_ASSERT_NOT_NULL(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/file", folder);
    UNITY_BEGIN();
    RUN_TEST(test_file_is_played_frame_by_frame_to_its_end);
    RUN_TEST(test_file_of_no_whole_frames_is_refused);
    RUN_TEST(test_paced_file_gives_a_frame_when_its_descriptor_says_so);
    RUN_TEST(test_socket_gives_whole_frames_and_ends_when_the_sender_does);
    RUN_TEST(test_board_keeps_and_records_the_last_duties);
    RUN_TEST(test_exactly_the_chosen_calls_fail);
    const int failures = UNITY_END();
    rmdir(folder);
    return failures;
}

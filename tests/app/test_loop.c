// SPDX-License-Identifier: Apache-2.0
// Tests of firmware/app/loop.c and loop_update.c
#include "loop.h"

#include <math.h>

#include "robot.h"

void setUp(void)
{
    robot_make();
}

void tearDown(void)
{
    robot_free();
}

// Test

static void test_green_turns_left_and_grey_turns_right(void)
{
    robot_drive(VIEW_GREEN);
    ASSERT_DUTIES(left_pct);
    robot.view = VIEW_GREY;
    robot_steps(15);
    ASSERT_DUTIES(right_pct);
}

static void test_robot_waits_for_a_start(void)
{
    robot.view = VIEW_GREEN;
    robot_boot();
    robot_steps(30);
    TEST_ASSERT_TRUE(robot_stands());
    TEST_ASSERT_EQUAL(FW_MODE_STOPPED, robot.report.out.mode);
    TEST_ASSERT_EQUAL(1, robot.report.out.detected);
}

// The same frames at the same times through the core alone.
static void test_duties_are_those_of_the_core(void)
{
    struct fw_config config;
    struct fw_ctx core;
    TEST_ASSERT_EQUAL(FW_OK, config_core(&robot.config, &config));
    TEST_ASSERT_EQUAL(FW_OK, fw_init(&core, &config));
    robot_boot();
    loop_start(&robot.loop);
    robot_steps(1);  // opens the camera
    uint32_t random = 1;
    for (int i = 0; i < 300; ++i)
    {
        robot.view = random_next(&random) % 3 == 0 ? VIEW_GREEN : VIEW_GREY;
        const uint32_t seq = robot.frame_seq;
        loop_step(&robot.loop);
        const struct image *image = robot.view == VIEW_GREEN ? &robot.green : &robot.grey;
        const struct fw_frame frame = {
            image->yuyv,         image->width_px,         image->height_px,
            image->stride_bytes, robot.hand.monotonic_us, seq,
            image->length_bytes};
        struct fw_output out;
        fw_step(&core, &frame, robot.hand.monotonic_us, &out);
        ASSERT_DUTIES(out.wheel_duty_pct);
    }
}

// However the time of the last frame falls, the wheels stop at most one wake-up after 200 ms.
static void test_motors_stop_200_ms_after_the_last_frame(void)
{
    robot_drive(VIEW_GREEN);
    const int64_t last_frame_us = robot.hand.monotonic_us;
    robot.view = VIEW_NOTHING;
    robot.hand.wait_us = INT64_MAX;  // only the loop's own time-outs wake it
    while (!robot_stands())
    {
        TEST_ASSERT_LESS_OR_EQUAL_INT64(200000, robot.hand.monotonic_us - last_frame_us);
        loop_step(&robot.loop);
    }
    TEST_ASSERT_LESS_OR_EQUAL_INT64(200001, robot.hand.monotonic_us - last_frame_us);
    TEST_ASSERT_EQUAL(FW_MODE_FAULT, robot.report.out.mode);
    robot.hand.wait_us = ROBOT_PERIOD_US;
    robot.view = VIEW_GREEN;
    robot_steps(10);
    ASSERT_DUTIES(left_pct);
}

static void test_unplugged_camera_stops_at_once_and_comes_back(void)
{
    robot_drive(VIEW_GREEN);
    robot.view = VIEW_UNPLUGGED;
    robot_steps(1);
    TEST_ASSERT_TRUE(robot_stands());
    TEST_ASSERT_FALSE(robot.camera_is_open);
    TEST_ASSERT_BITS(LINK_STATUS_CAMERA_LOST, LINK_STATUS_CAMERA_LOST, robot.report.status_flags);
    robot_steps(60);
    TEST_ASSERT_TRUE(robot_stands());
    robot.view = VIEW_GREEN;
    robot_steps(30);
    ASSERT_DUTIES(left_pct);
    TEST_ASSERT_EQUAL(LINK_STATUS_UNTETHERED, robot.report.status_flags);
}

// However long a frame may decide, none from before the loss does.
static void test_frames_from_before_a_loss_decide_nothing(void)
{
    robot.config.frame_timeout_ms = 10000;
    robot_drive(VIEW_GREEN);
    robot.view = VIEW_UNPLUGGED;
    robot_steps(1);
    robot.view = VIEW_NOTHING;
    for (int i = 0; i < 60; ++i)
    {
        robot_steps(1);
        TEST_ASSERT_TRUE(robot_stands());
    }
    TEST_ASSERT_TRUE(robot.camera_is_open);
}

// Stamps and numbers go on, the picture does not.
static void test_picture_that_never_changes_is_none(void)
{
    robot.config.frozen_ms = 2000;
    robot.devices.camera_is_live = true;
    robot_drive(VIEW_GREEN);
    const int64_t since_us = robot.loop.picture_since_us;
    while (!robot_stands())
    {
        TEST_ASSERT_LESS_OR_EQUAL_INT64(2000000 + ROBOT_PERIOD_US,
                                        robot.hand.monotonic_us - since_us);
        robot_steps(1);
    }
    TEST_ASSERT_GREATER_THAN_INT64(2000000, robot.hand.monotonic_us - since_us);
    TEST_ASSERT_BITS_HIGH(LINK_STATUS_CAMERA_LOST, robot.report.status_flags);
    for (int i = 0; i < 300; ++i)
    {
        robot_steps(1);
        TEST_ASSERT_TRUE(robot_stands());
    }
    robot.green.yuyv[0] ^= 1;
    robot_steps(30);
    ASSERT_DUTIES(left_pct);
}

static void test_lost_board_is_stopped_before_it_moves_again(void)
{
    robot_drive(VIEW_GREEN);
    robot.faults = (struct stub_faults){.fails_at = 1, .fails_count = 1000, .err = FW_ERR_IO};
    robot_steps(5);
    TEST_ASSERT_BITS(LINK_STATUS_BOARD_LOST, LINK_STATUS_BOARD_LOST, robot.report.status_flags);
    TEST_ASSERT_EQUAL(FW_MODE_FAULT, robot.report.out.mode);
    // The board still turns its wheels; the first it hears again is a stop.
    robot.faults.fails_at = 0, robot.faults.fails_count = 0;
    const int stops = robot.board.stop_count, writes = robot.board.write_count;
    robot_steps(1);
    TEST_ASSERT_EQUAL(writes, robot.board.write_count);
    TEST_ASSERT_GREATER_THAN(stops, robot.board.stop_count);
    robot_steps(40);
    ASSERT_DUTIES(left_pct);
}

static void test_end_of_a_recording_stops_and_is_told(void)
{
    robot_drive(VIEW_GREEN);
    robot.view = VIEW_OVER;
    robot_steps(1);
    TEST_ASSERT_TRUE(robot_stands());
    TEST_ASSERT_TRUE(robot.loop.camera_over);
}

static void test_button_starts_and_stops_once_per_press(void)
{
    robot.view = VIEW_GREEN;
    robot_boot();
    robot_steps(15);
    robot.panel.pressed = true;
    robot_steps(20);
    ASSERT_DUTIES(left_pct);
    robot.panel.pressed = false;
    robot_steps(5);
    ASSERT_DUTIES(left_pct);
    robot.panel.pressed = true;
    robot_steps(3);
    TEST_ASSERT_TRUE(robot_stands());
}

static void test_bounce_of_one_step_is_no_press(void)
{
    robot.view = VIEW_GREEN;
    robot_boot();
    robot_steps(15);
    for (int i = 0; i < 10; ++i)
    {
        robot.panel.pressed = i % 2 == 0;
        robot_steps(1);
    }
    TEST_ASSERT_TRUE(robot_stands());
}

static void test_lights_show_detection_and_mode(void)
{
    robot_drive(VIEW_GREEN);
    TEST_ASSERT_TRUE(robot.panel.shown.detected && robot.panel.shown.running);
    robot.view = VIEW_GREY;
    loop_stop(&robot.loop);
    robot_steps(15);
    TEST_ASSERT_FALSE(robot.panel.shown.detected || robot.panel.shown.running);
}

static void test_low_battery_stops_for_good_and_sounds(void)
{
    robot_drive(VIEW_GREEN);
    robot.board.pack_mV = 6899;
    robot_steps(30 * 7);
    TEST_ASSERT_TRUE(robot_stands());
    TEST_ASSERT_BITS(LINK_STATUS_BATTERY_LOW, LINK_STATUS_BATTERY_LOW, robot.report.status_flags);
    bool sounded = false, paused = false;
    for (int i = 0; i < 60; ++i)
    {
        robot_steps(1);
        sounded = sounded || robot.panel.shown.buzzer;
        paused = paused || !robot.panel.shown.buzzer;
    }
    TEST_ASSERT_TRUE(sounded && paused);
    // At rest a pack recovers: that is no reason to move again.
    robot.board.pack_mV = 7400;
    robot_steps(30 * 7);
    TEST_ASSERT_TRUE(robot_stands());
}

static void test_short_dip_of_the_battery_is_no_reason_to_stop(void)
{
    robot_drive(VIEW_GREEN);
    for (int second = 0; second < 20; ++second)
    {
        robot.board.pack_mV = second % 5 == 0 ? 6900 : 6500;
        robot_steps(31);
    }
    ASSERT_DUTIES(left_pct);
}

static void test_report_says_what_telemetry_needs(void)
{
    robot_drive(VIEW_GREEN);
    const struct link_report *report = &robot.report;
    TEST_ASSERT_EQUAL_INT64(robot.hand.monotonic_us + ROBOT_UNIX_OFFSET_US, report->utime_us);
    TEST_ASSERT_EQUAL_INT64(report->utime_us, report->frame_utime_us);
    TEST_ASSERT_EQUAL(ROBOT_WIDTH_PX * ROBOT_HEIGHT_PX, report->out.blob_px);
    TEST_ASSERT_EQUAL(FW_MODE_TABLE, report->out.mode);
    TEST_ASSERT_EQUAL(7800, report->pack_mV);
    TEST_ASSERT_EQUAL_STRING("milling", report->behavior);
    TEST_ASSERT_EQUAL(15, robot.report_count);
    TEST_ASSERT_EQUAL(14, report->out.seq);
}

static void test_reports_that_nobody_takes_are_counted(void)
{
    robot.takes_reports = false;
    robot_drive(VIEW_GREEN);
    ASSERT_DUTIES(left_pct);
    robot.takes_reports = true;
    robot_steps(1);
    TEST_ASSERT_EQUAL(15, robot.report.lost_report_count);
}

static void test_speed_cap_holds(void)
{
    robot.config.duty_cap_pct = 40;
    robot_drive(VIEW_GREEN);
    ASSERT_DUTIES(((const int8_t[4]){37, 40, 37, 40}));
}

static void test_close_stops_and_releases(void)
{
    robot_drive(VIEW_GREEN);
    loop_close(&robot.loop);
    TEST_ASSERT_TRUE(robot_stands());
    TEST_ASSERT_FALSE(robot.camera_is_open);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_green_turns_left_and_grey_turns_right);
    RUN_TEST(test_robot_waits_for_a_start);
    RUN_TEST(test_duties_are_those_of_the_core);
    RUN_TEST(test_motors_stop_200_ms_after_the_last_frame);
    RUN_TEST(test_unplugged_camera_stops_at_once_and_comes_back);
    RUN_TEST(test_frames_from_before_a_loss_decide_nothing);
    RUN_TEST(test_picture_that_never_changes_is_none);
    RUN_TEST(test_lost_board_is_stopped_before_it_moves_again);
    RUN_TEST(test_end_of_a_recording_stops_and_is_told);
    RUN_TEST(test_button_starts_and_stops_once_per_press);
    RUN_TEST(test_bounce_of_one_step_is_no_press);
    RUN_TEST(test_lights_show_detection_and_mode);
    RUN_TEST(test_low_battery_stops_for_good_and_sounds);
    RUN_TEST(test_short_dip_of_the_battery_is_no_reason_to_stop);
    RUN_TEST(test_report_says_what_telemetry_needs);
    RUN_TEST(test_reports_that_nobody_takes_are_counted);
    RUN_TEST(test_speed_cap_holds);
    RUN_TEST(test_close_stops_and_releases);
    return UNITY_END();
}

// SPDX-License-Identifier: Apache-2.0
// A robot of stub devices, whose time a test moves and whose camera a test fills.
#ifndef TESTS_APP_ROBOT_H
#define TESTS_APP_ROBOT_H

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "../firmware/support.h"
#include "hal_stub/stub_board.h"
#include "hal_stub/stub_clock.h"
#include "hal_stub/stub_panel.h"
#include "loop.h"
#include "loop_commands.h"
#include "loop_link.h"
#include "unity.h"

#define ROBOT_WIDTH_PX 32
#define ROBOT_HEIGHT_PX 16
#define ROBOT_PERIOD_US 33333
#define ROBOT_UNIX_OFFSET_US 1700000000000000
#define ROBOT_SESSION 77
#define ROBOT_KEY_NAME "01234567"

// What the camera shows at the next take.
enum robot_view
{
    VIEW_GREY,
    VIEW_GREEN,
    VIEW_NOTHING,
    VIEW_UNPLUGGED,
    VIEW_OVER,
};

static struct robot
{
    struct stub_faults faults;
    struct stub_clock hand;
    struct stub_board board;
    struct stub_panel panel;
    struct loop_devices devices;
    struct app_config config;
    struct own_tables own;
    struct loop loop;

    enum robot_view view;
    bool camera_is_open;
    uint32_t frame_seq;
    struct image grey, green;

    // The other side of the link.
    struct link_report report;
    int report_count;
    bool takes_reports;
    struct link_command command;
    bool has_command;
    struct link_ack ack;
    int ack_count;
    // Of the commands that are told.
    int32_t link_timeout_ms;
} robot;

static enum fw_err robot_camera_open(void *device, struct hal_camera_format *format)
{
    (void)device;
    const enum fw_err err = stub_faults_next(&robot.faults);
    if (err == FW_OK && robot.view == VIEW_UNPLUGGED)
    {
        return FW_ERR_NO_DEVICE;
    }
    robot.camera_is_open = err == FW_OK;
    *format = (struct hal_camera_format){ROBOT_WIDTH_PX, ROBOT_HEIGHT_PX};
    return err;
}

static enum fw_err robot_camera_take(void *device, struct fw_frame *frame)
{
    (void)device;
    TEST_ASSERT_TRUE(robot.camera_is_open);
    const enum fw_err err = stub_faults_next(&robot.faults);
    if (err != FW_OK || robot.view > VIEW_GREEN)
    {
        return err != FW_OK                   ? err
               : robot.view == VIEW_UNPLUGGED ? FW_ERR_NO_DEVICE
               : robot.view == VIEW_OVER      ? FW_ERR_END
                                              : FW_ERR_TIMEOUT;
    }
    const struct image *image = robot.view == VIEW_GREEN ? &robot.green : &robot.grey;
    *frame = (struct fw_frame){
        .yuyv = image->yuyv,
        .width_px = image->width_px,
        .height_px = image->height_px,
        .stride_bytes = image->stride_bytes,
        .utime_us = robot.hand.monotonic_us,
        .seq = robot.frame_seq++,
        .length_bytes = image->length_bytes,
    };
    return FW_OK;
}

static inline bool robot_stands(void)
{
    static const int8_t zero_pct[FW_WHEEL_COUNT] = {0};
    return memcmp(robot.board.wheel_duty_pct, zero_pct, sizeof zero_pct) == 0;
}

// It may take seconds.
static void robot_camera_close(void *device)
{
    (void)device;
    TEST_ASSERT_TRUE_MESSAGE(robot_stands(), "the camera is closed while wheels turn");
    robot.camera_is_open = false;
}

static int robot_camera_fd(const void *device)
{
    (void)device;
    return -1;
}

static void robot_camera_stats(const void *device, struct hal_camera_stats *stats)
{
    (void)device;
    *stats = (struct hal_camera_stats){.taken_count = robot.frame_seq};
}

static bool robot_send_report(void *context, const struct link_report *report)
{
    (void)context;
    robot.report = *report;
    robot.report_count += robot.takes_reports;
    return robot.takes_reports;
}

static void robot_send_ack(void *context, const struct link_ack *ack)
{
    (void)context;
    robot.ack = *ack;
    ++robot.ack_count;
}

static bool robot_receive(void *context, struct link_command *command)
{
    (void)context;
    const bool had = robot.has_command;
    *command = robot.command;
    robot.has_command = false;
    return had;
}

static inline void robot_free(void)
{
    free(robot.grey.yuyv);
    free(robot.green.yuyv);
    memset(&robot, 0, sizeof robot);
}

// A robot with its devices switched on; tests change the configuration before robot_boot().
static inline void robot_make(void)
{
    static const struct hal_camera_ops camera_ops = {robot_camera_open, robot_camera_take,
                                                     robot_camera_close, robot_camera_fd,
                                                     robot_camera_stats};
    memset(&robot, 0, sizeof robot);
    robot.hand = (struct stub_clock){.monotonic_us = 1000000,
                                     .unix_offset_us = ROBOT_UNIX_OFFSET_US,
                                     .wait_us = ROBOT_PERIOD_US};
    const struct hal_clock clock = stub_clock_make(&robot.hand);
    robot.board = (struct stub_board){.faults = &robot.faults, .clock = clock, .pack_mV = 7800};
    robot.panel.faults = &robot.faults;
    robot.devices = (struct loop_devices){
        .camera = {NULL, &camera_ops},
        .motors = stub_board_motors(&robot.board),
        .battery = stub_board_battery(&robot.board),
        .panel = stub_panel_make(&robot.panel),
        .clock = clock,
    };
    robot.grey = image_make(ROBOT_WIDTH_PX, ROBOT_HEIGHT_PX, 0);
    robot.green = image_make(ROBOT_WIDTH_PX, ROBOT_HEIGHT_PX, 0);
    image_fill(&robot.green, 0, 0, ROBOT_WIDTH_PX, ROBOT_HEIGHT_PX, kGreen);
    robot.takes_reports = true;
    config_default(&robot.config);
    robot.config.width_px = ROBOT_WIDTH_PX;
    robot.config.height_px = ROBOT_HEIGHT_PX;
    robot.config.run_dir[0] = '\0';
}

static inline void robot_boot(void)
{
    const struct link link = {.send_report = robot_send_report,
                              .send_ack = robot_send_ack,
                              .receive = robot_receive,
                              .fd = -1,
                              .session = ROBOT_SESSION,
                              .key_name = ROBOT_KEY_NAME};
    TEST_ASSERT_EQUAL(FW_OK,
                      loop_init(&robot.loop, &robot.config, &robot.own, &robot.devices, &link));
}

static inline void robot_steps(int count)
{
    for (int i = 0; i < count; ++i)
    {
        loop_step(&robot.loop);
    }
}

static inline int64_t robot_unix_us(void)
{
    return robot.hand.monotonic_us + robot.hand.unix_offset_us;
}

// Sends a command that its operator signed `age_us` ago, and lets the robot read it.
// @return true if accepted.
static inline bool robot_tell_as_of(int64_t age_us, enum fw_verb verb, int64_t start_utime_us,
                                    const char *name)
{
    static int32_t seq;
    ++seq;
    robot.command =
        (struct link_command){.order = {.utime_us = robot_unix_us() - age_us,
                                        .seq = seq,
                                        .verb = (int8_t)verb,
                                        .start_utime_us = start_utime_us,
                                        .seal = FW_SEAL_GOOD,
                                        .session = ROBOT_SESSION,
                                        .made_us = loop_link_session_us(&robot.loop) - age_us,
                                        .counter = seq,
                                        .link_timeout_ms = robot.link_timeout_ms}};
    (void)snprintf(robot.command.name, sizeof robot.command.name, "%s", name);
    robot.has_command = true;
    const int acks = robot.ack_count;
    robot_steps(1);
    TEST_ASSERT_EQUAL(acks + 1, robot.ack_count);
    TEST_ASSERT_EQUAL(seq, robot.ack.seq);
    TEST_ASSERT_TRUE(robot.ack.accepted || robot.ack.reason[0] != '\0');
    return robot.ack.accepted;
}

static inline bool robot_tell(enum fw_verb verb, int64_t start_utime_us, const char *name)
{
    return robot_tell_as_of(0, verb, start_utime_us, name);
}

// A robot that has driven for half a second.
static inline void robot_drive(enum robot_view view)
{
    robot.view = view;
    robot_boot();
    loop_start(&robot.loop);
    robot_steps(15);
}

// Milling, by hand: 100 -+ 126 * 0.5, so that the slow side has 37.
static const int8_t left_pct[FW_WHEEL_COUNT] = {37, 100, 37, 100};
static const int8_t right_pct[FW_WHEEL_COUNT] = {100, 37, 100, 37};

#define ASSERT_DUTIES(expected) \
    TEST_ASSERT_EQUAL_INT8_ARRAY(expected, robot.board.wheel_duty_pct, FW_WHEEL_COUNT)

#endif

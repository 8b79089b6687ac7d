// SPDX-License-Identifier: Apache-2.0
// Any messages on the swarm's command channel, through LCM, telemetry and the robot's loop: each is
// ignored or answered, and a stop stops whatever came before it.
#include <turbopi_swarm_command_t.h>

#include "fuzz.h"
#include "hal_stub/stub_board.h"
#include "hal_stub/stub_clock.h"
#include "hal_stub/stub_panel.h"
#include "loop.h"
#include "telemetry.h"

#define CHANNEL "SWARM_COMMAND"
#define MAX_MESSAGES 32

static struct app_config config;
static struct own_tables own;
static struct telemetry telemetry;
static struct loop loop;
static struct stub_clock hand;
static struct stub_board board;
static struct stub_panel panel;
static struct link_command waiting;
static bool has_waiting;
static int heard_count, ack_count;
static struct link_ack last_ack;

static void on_command(void *context, const struct link_command *command)
{
    (void)context;
    waiting = *command;
    has_waiting = true;
    ++heard_count;
}

static bool receive(void *context, struct link_command *command)
{
    (void)context;
    const bool had = has_waiting;
    *command = waiting;
    has_waiting = false;
    return had;
}

static bool send_report(void *context, const struct link_report *report)
{
    (void)context;
    telemetry_publish(&telemetry, report);
    return true;
}

static void send_ack(void *context, const struct link_ack *ack)
{
    (void)context;
    CLAIM(memchr(ack->reason, '\0', sizeof ack->reason) != NULL);
    CLAIM(ack->accepted == (ack->reason[0] == '\0'));
    telemetry_publish_ack(&telemetry, ack);
    last_ack = *ack;
    ++ack_count;
}

// A camera that is always there and shows a grey picture.
static enum fw_err camera_open(void *device, struct hal_camera_format *format)
{
    (void)device;
    *format = (struct hal_camera_format){2, 1};
    return FW_OK;
}

static enum fw_err camera_take(void *device, struct fw_frame *frame)
{
    static const uint8_t grey[] = {126, 128, 126, 128};
    (void)device;
    *frame = (struct fw_frame){.yuyv = grey,
                               .width_px = 2,
                               .height_px = 1,
                               .stride_bytes = 4,
                               .utime_us = hand.monotonic_us,
                               .length_bytes = sizeof grey};
    return FW_OK;
}

static void camera_close(void *device)
{
    (void)device;
}

static int camera_fd(const void *device)
{
    (void)device;
    return -1;
}

static void camera_stats(const void *device, struct hal_camera_stats *stats)
{
    (void)device;
    *stats = (struct hal_camera_stats){0};
}

static void boot(void)
{
    static const struct hal_camera_ops camera_ops = {camera_open, camera_take, camera_close,
                                                     camera_fd, camera_stats};
    hand = (struct stub_clock){
        .monotonic_us = 1000000, .unix_offset_us = 1700000000000000, .wait_us = 33333};
    const struct hal_clock clock = stub_clock_make(&hand);
    board = (struct stub_board){.clock = clock, .pack_mV = 7800};
    const struct loop_devices devices = {.camera = {NULL, &camera_ops},
                                         .motors = stub_board_motors(&board),
                                         .battery = stub_board_battery(&board),
                                         .panel = stub_panel_make(&panel),
                                         .clock = clock};
    const struct link link = {NULL, send_report, send_ack, receive, -1};
    if (telemetry.lcm == NULL)
    {
        config_default(&config);
        strcpy(config.lcm_url, "memq://");
        telemetry_init(&telemetry, &config, on_command, NULL);
        telemetry_connect(&telemetry, 0);
        CLAIM(telemetry.lcm != NULL);
    }
    heard_count = ack_count = 0;
    CLAIM(loop_init(&loop, &config, &own, &devices, &link) == FW_OK);
    loop_step(&loop);
}

// Hears what is on the bus, then does one step. Its own reports are on the bus as well.
static void hear_and_step(const uint8_t *bytes, size_t count)
{
    CLAIM(lcm_publish(telemetry.lcm, CHANNEL, bytes, (unsigned)count) == 0);
    while (lcm_handle_timeout(telemetry.lcm, 0) > 0)
    {
    }
    loop_step(&loop);
    CLAIM(ack_count == heard_count);
}

static void stop_for_good(void)
{
    static char nothing[] = "";
    const turbopi_swarm_command_t stop = {.robot_id = -1, .behavior = nothing};
    uint8_t bytes[64];
    const int count = turbopi_swarm_command_t_encode(bytes, 0, sizeof bytes, &stop);
    const int acks = ack_count;
    hear_and_step(bytes, (size_t)count);
    CLAIM(ack_count == acks + 1 && last_ack.accepted);
    for (int i = 0; i < 3; ++i)
    {
        static const int8_t zero_pct[FW_WHEEL_COUNT] = {0};
        CLAIM(!loop.running && !loop.moving);
        CLAIM(memcmp(board.wheel_duty_pct, zero_pct, sizeof zero_pct) == 0);
        loop_step(&loop);
    }
}

// Each message: one byte that says whether LCM's type precedes it, one of length, its bytes.
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct bytes in = {data, size};
    boot();
    uint8_t message[8 + 255];
    const turbopi_swarm_command_t any = {.behavior = ""};
    for (int i = 0; i < MAX_MESSAGES && in.left > 0; ++i)
    {
        const bool with_type = take(&in, 1) != 0;
        size_t count = 0;
        uint8_t *block = take_block(&in, take(&in, 1), &count);
        (void)turbopi_swarm_command_t_encode(message, 0, sizeof message, &any);
        memcpy(message + 8, block, count);
        hear_and_step(with_type ? message : block, with_type ? count + 8 : count);
        free(block);
    }
    stop_for_good();
    return 0;
}

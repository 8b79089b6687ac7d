// SPDX-License-Identifier: Apache-2.0
// Any datagrams, and any signed commands, through the robot's own receiver and loop: each is
// ignored or answered, none without a signature moves the robot, and a stop stops whatever came
// before it.
#include <turbopi_signed_command_t.h>
#include <turbopi_swarm_command_t.h>

#include "fuzz.h"
#include "hal_stub/stub_board.h"
#include "hal_stub/stub_clock.h"
#include "hal_stub/stub_panel.h"
#include "loop.h"
#include "loop_link.h"
#include "radio/lcm_packet.h"
#include "radio/wire.h"

#define MAX_MESSAGES 32
#define SESSION 77
#define ROBOT_ID 3

static struct app_config config;
static struct own_tables own;
static struct loop loop;
static struct stub_clock hand;
static struct stub_board board;
static struct stub_panel panel;
static struct link_command waiting;
static bool has_waiting, was_signed;
static int heard_count, ack_count;
static struct link_ack last_ack;
static const struct seal_key key = {.present = true, .bytes = {1, 2, 3}};

// As the radio does with what it reads.
static void hear(const struct wire_command *command)
{
    if (command->robot_id != WIRE_ALL_ROBOTS && command->robot_id != ROBOT_ID)
    {
        return;
    }
    waiting = (struct link_command){.order = command->order};
    memcpy(waiting.name, command->name, sizeof waiting.name);
    CLAIM(memchr(waiting.name, '\0', sizeof waiting.name) != NULL);
    was_signed = was_signed || command->order.seal == FW_SEAL_GOOD;
    has_waiting = true;
    heard_count += command->order.verb != FW_VERB_HOLD;
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
    (void)report;
    return true;
}

static void send_ack(void *context, const struct link_ack *ack)
{
    (void)context;
    CLAIM(memchr(ack->reason, '\0', sizeof ack->reason) != NULL);
    CLAIM(ack->accepted || ack->reason[0] != '\0');
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
    const struct link link = {.send_report = send_report,
                              .send_ack = send_ack,
                              .receive = receive,
                              .fd = -1,
                              .session = SESSION};
    config_default(&config);
    config.run_dir[0] = '\0';
    config.robot_id = ROBOT_ID;
    heard_count = ack_count = 0;
    was_signed = false;
    CLAIM(loop_init(&loop, &config, &own, &devices, &link) == FW_OK);
    loop_step(&loop);
}

static void step(void)
{
    loop_step(&loop);
    CLAIM(ack_count == heard_count);
    CLAIM(was_signed || (!loop.running && !loop.may_move && !loop.plan.waits));
}

// A datagram as it comes from the network.
static void hear_datagram(const uint8_t *bytes, size_t count)
{
    struct lcm_packet packet;
    struct wire_command command;
    int64_t session;
    int32_t robot_id;
    if (!lcm_packet_read(bytes, count, &packet))
    {
        return;
    }
    (void)wire_peek_session(packet.data, packet.size, &session);
    (void)wire_peek_robot(packet.data, packet.size, &robot_id);
    if (wire_read_command(packet.data, packet.size, &command))
    {
        hear(&command);
        step();
    }
    if (wire_read_signed(packet.data, packet.size, &key, &command))
    {
        hear(&command);
        step();
    }
}

// What an operator with the key may sign, however mad.
static void hear_operator(struct bytes *in)
{
    uint8_t inner[128], bytes[256];
    char name[] = "........";
    const int8_t verb = (int8_t)(take(in, 1) % 8);
    for (size_t i = 0; i + 1 < sizeof name; ++i)
    {
        name[i] = (char)take(in, 1);
    }
    const turbopi_swarm_command_t order = {.utime_us = (int64_t)take(in, 8),
                                           .seq = (int32_t)take(in, 1),
                                           .verb = verb,
                                           .start_utime_us = (int64_t)take(in, 8),
                                           .behavior = name};
    turbopi_signed_command_t message = {
        .robot_id = ROBOT_ID,
        .session = take(in, 1) % 4 == 0 ? (int64_t)take(in, 8) : SESSION,
        .made_us = take(in, 1) % 4 == 0 ? (int64_t)take(in, 8) : loop_link_session_us(&loop),
        .counter = (int64_t)take(in, take(in, 1) % 9),
        .link_timeout_ms = (int32_t)take(in, 4),
        .command = inner};
    message.command_size = turbopi_swarm_command_t_encode(inner, 0, sizeof inner, &order);
    const int size = turbopi_signed_command_t_encode(bytes, 0, sizeof bytes, &message);
    CLAIM(size > 0);
    seal_sign(&key, bytes, (size_t)size);
    struct wire_command command;
    CLAIM(wire_read_signed(bytes, (size_t)size, &key, &command));
    CLAIM(command.order.seal == FW_SEAL_GOOD);
    hear(&command);
    step();
}

static void stop_for_good(void)
{
    static const int8_t zero_pct[FW_WHEEL_COUNT] = {0};
    const struct wire_command stop = {.robot_id = WIRE_ALL_ROBOTS};
    const int acks = ack_count;
    hear(&stop);
    step();
    CLAIM(ack_count == acks + 1 && last_ack.accepted && last_ack.stands);
    for (int i = 0; i < 3; ++i)
    {
        CLAIM(!loop.running && !loop.may_move && loop.filter.latched);
        CLAIM(memcmp(board.wheel_duty_pct, zero_pct, sizeof zero_pct) == 0);
        loop_step(&loop);
    }
}

// Each message: one byte that says whether it is a datagram of so many bytes, or an operator's.
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct bytes in = {data, size};
    boot();
    for (int i = 0; i < MAX_MESSAGES && in.left > 0; ++i)
    {
        const size_t length = take(&in, 1);
        if (length == 0)
        {
            hear_operator(&in);
            continue;
        }
        size_t count = 0;
        uint8_t *block = take_block(&in, length, &count);
        hear_datagram(block, count);
        free(block);
    }
    stop_for_good();
    return 0;
}

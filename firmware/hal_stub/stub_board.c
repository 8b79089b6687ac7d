// SPDX-License-Identifier: Apache-2.0
#include "hal_stub/stub_board.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static void close_board(void *device)
{
    struct stub_board *board = device;
    if (board->is_open)
    {
        (void)close(board->fd);
        board->is_open = false;
    }
}

// The record is opened once, as a device is.
static enum fw_err open_board(void *device)
{
    struct stub_board *board = device;
    if (board->record_path != NULL && !board->is_open)
    {
        board->fd = open(board->record_path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
        board->is_open = board->fd >= 0;
    }
    return board->record_path == NULL || board->is_open ? FW_OK : FW_ERR_NO_DEVICE;
}

// One line in one write, so that several processes may record into one file.
static enum fw_err record(struct stub_board *board)
{
    const enum fw_err opened = open_board(board);
    if (opened != FW_OK || !board->is_open)
    {
        return opened;
    }
    const int8_t *duty_pct = board->wheel_duty_pct;
    char line[64];
    const int length =
        snprintf(line, sizeof line, "%" PRId64 ",%d,%d,%d,%d\n",
                 hal_clock_monotonic_us(&board->clock), duty_pct[FW_FRONT_LEFT],
                 duty_pct[FW_FRONT_RIGHT], duty_pct[FW_REAR_LEFT], duty_pct[FW_REAR_RIGHT]);
    if (write(board->fd, line, (size_t)length) != length)
    {
        close_board(board);
        return FW_ERR_IO;
    }
    return FW_OK;
}

// The camera may not be connected yet, or no more: then nobody waits for an answer.
static enum fw_err answer(const struct stub_board *board)
{
    const struct stub_camera *camera = board->answers_to;
    if (camera == NULL || camera->config.path == NULL || camera->fd < 0)
    {
        return FW_OK;
    }
    const uint32_t taken = camera->seq;
    uint8_t bytes[8] = {(uint8_t)taken, (uint8_t)(taken >> 8), (uint8_t)(taken >> 16),
                        (uint8_t)(taken >> 24)};
    memcpy(bytes + 4, board->wheel_duty_pct, FW_WHEEL_COUNT);
    const ssize_t sent = send(camera->fd, bytes, sizeof bytes, MSG_NOSIGNAL | MSG_DONTWAIT);
    return sent == sizeof bytes || errno == EPIPE || errno == ECONNRESET ? FW_OK : FW_ERR_IO;
}

static enum fw_err put(struct stub_board *board, const int8_t wheel_duty_pct[FW_WHEEL_COUNT])
{
    const enum fw_err err = stub_faults_next(board->faults);
    if (err != FW_OK)
    {
        return err;
    }
    memcpy(board->wheel_duty_pct, wheel_duty_pct, sizeof board->wheel_duty_pct);
    const enum fw_err recorded = record(board);
    const enum fw_err answered = answer(board);
    return recorded != FW_OK ? recorded : answered;
}

static enum fw_err write_duties(void *device, const int8_t wheel_duty_pct[FW_WHEEL_COUNT])
{
    struct stub_board *board = device;
    const enum fw_err err = put(board, wheel_duty_pct);
    board->write_count += err == FW_OK;
    return err;
}

static enum fw_err stop(void *device)
{
    static const int8_t zero_pct[FW_WHEEL_COUNT] = {0};
    struct stub_board *board = device;
    ++board->stop_try_count;
    const enum fw_err err = put(board, zero_pct);
    board->stop_count += err == FW_OK;
    return err;
}

static enum fw_err confirm(void *device)
{
    static const int8_t zero_pct[FW_WHEEL_COUNT] = {0};
    const struct stub_board *board = device;
    const enum fw_err err = stub_faults_next(board->faults);
    if (err != FW_OK)
    {
        return err;
    }
    return memcmp(board->wheel_duty_pct, zero_pct, sizeof zero_pct) == 0 ? FW_OK : FW_ERR_NOT_ZERO;
}

static enum fw_err read_battery(void *device, int32_t *pack_mV)
{
    const struct stub_board *board = device;
    const enum fw_err err = stub_faults_next(board->faults);
    if (err == FW_OK)
    {
        *pack_mV = board->pack_mV;
    }
    return err;
}

struct hal_motors stub_board_motors(struct stub_board *board)
{
    static const struct hal_motors_ops ops = {open_board, write_duties, stop, confirm, close_board};
    return (struct hal_motors){.device = board, .ops = &ops};
}

struct hal_battery stub_board_battery(struct stub_board *board)
{
    static const struct hal_battery_ops ops = {read_battery};
    return (struct hal_battery){.device = board, .ops = &ops};
}

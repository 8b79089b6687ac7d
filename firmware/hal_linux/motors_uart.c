// SPDX-License-Identifier: Apache-2.0
#include "hal_linux/motors_uart.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include "hal_linux/sys.h"
#include "uart_frame.h"

#define FUNCTION_SYSTEM 0
#define FUNCTION_MOTOR 3
#define SYSTEM_BATTERY 4
#define MOTOR_DUTY 5
// The board reports many times a second; after this long without, it is gone.
#define HEARD_US 2000000
#define PROBE_US 1500000
#define RECEIVE_TURNS 64
#define RETRY_PAUSE_US 500

static void close_line(void *device)
{
    struct motors_uart *board = device;
    if (board->fd >= 0)
    {
        (void)close(board->fd);
        board->fd = -1;
        board->received_count = 0;
        board->has_battery = false;
        board->was_heard = false;
    }
}

static enum fw_err open_line(void *device)
{
    struct motors_uart *board = device;
    if (board->fd >= 0)
    {
        return FW_OK;
    }
    board->fd = open(board->config.path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (board->fd < 0)
    {
        return hal_sys_err(errno);
    }
    struct termios line;
    if (tcgetattr(board->fd, &line) == 0)
    {
        cfmakeraw(&line);
        line.c_cflag |= CLOCAL | CREAD;
        if (cfsetspeed(&line, B1000000) == 0 && tcsetattr(board->fd, TCSANOW, &line) == 0)
        {
            return FW_OK;
        }
    }
    const enum fw_err err = hal_sys_err(errno);
    close_line(board);
    return err;
}

// A line that takes no more bytes is asked again until the deadline.
static enum fw_err send_frame(struct motors_uart *board, const uint8_t *frame, size_t count)
{
    const int64_t deadline_us = hal_clock_monotonic_us(&board->clock) + board->config.retry_us;
    enum fw_err err = open_line(board);
    size_t sent = 0;
    while (err == FW_OK && sent < count)
    {
        const ssize_t done = write(board->fd, frame + sent, count - sent);
        if (done > 0)
        {
            sent += (size_t)done;
        }
        else if (done < 0 && errno != EAGAIN && errno != EINTR)
        {
            err = hal_sys_err(errno);
        }
        else if (hal_clock_monotonic_us(&board->clock) >= deadline_us)
        {
            err = FW_ERR_TIMEOUT;
        }
        else
        {
            hal_clock_wait(&board->clock, NULL, 0, RETRY_PAUSE_US);
        }
    }
    if (err != FW_OK)
    {
        close_line(board);
    }
    return err;
}

// The board wants IEEE 754 single precision, little-endian; whole percents are exact in it.
static void put_float(uint8_t *bytes, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    for (int i = 0; i < 4; ++i)
    {
        bytes[i] = (uint8_t)(bits >> (8 * i));
    }
}

static enum fw_err write_duties(void *device, const int8_t wheel_duty_pct[FW_WHEEL_COUNT])
{
    struct motors_uart *board = device;
    uint8_t data[2 + 5 * FW_WHEEL_COUNT] = {MOTOR_DUTY, FW_WHEEL_COUNT};
    for (int wheel = 0; wheel < FW_WHEEL_COUNT; ++wheel)
    {
        uint8_t *entry = data + 2 + 5 * wheel;
        entry[0] = (uint8_t)wheel;
        put_float(entry + 1, (float)(board->config.sign[wheel] * wheel_duty_pct[wheel]));
    }
    uint8_t frame[UART_FRAME_OVERHEAD + sizeof data];
    const size_t count = uart_frame_make(FUNCTION_MOTOR, data, sizeof data, frame);
    return send_frame(board, frame, count);
}

// Twice: nothing answers it, and one frame is lost to noise or to the part of a frame that a killed
// process has left.
static enum fw_err stop(void *device)
{
    static const int8_t zero_pct[FW_WHEEL_COUNT] = {0};
    const enum fw_err err = write_duties(device, zero_pct);
    return err != FW_OK ? err : write_duties(device, zero_pct);
}

static void drop_received(struct motors_uart *board, size_t count)
{
    board->received_count -= count;
    memmove(board->received, board->received + count, board->received_count);
}

// Function 0, data 04 and the pack's millivolts, two bytes little-endian.
static void parse_received(struct motors_uart *board)
{
    const uint8_t *bytes = board->received;
    while (board->received_count > 0)
    {
        const enum uart_frame_state state =
            uart_frame_check(bytes, board->received_count, sizeof board->received);
        if (state == UART_FRAME_PART)
        {
            return;
        }
        if (state == UART_FRAME_BAD)
        {
            drop_received(board, 1);
            continue;
        }
        // A line may give back what it was sent.
        if (bytes[2] != FUNCTION_MOTOR)
        {
            board->was_heard = true;
            board->heard_us = hal_clock_monotonic_us(&board->clock);
        }
        if (bytes[2] == FUNCTION_SYSTEM && bytes[3] == 3 && bytes[4] == SYSTEM_BATTERY)
        {
            board->pack_mV = bytes[5] + 256 * bytes[6];
            board->has_battery = true;
        }
        drop_received(board, UART_FRAME_OVERHEAD + (size_t)bytes[3]);
    }
}

// Takes in what has come. Bounded: the board may send without end.
static enum fw_err receive(struct motors_uart *board)
{
    enum fw_err err = open_line(board);
    for (int turns = 0; err == FW_OK && turns < RECEIVE_TURNS; ++turns)
    {
        const ssize_t done = read(board->fd, board->received + board->received_count,
                                  sizeof board->received - board->received_count);
        if (done < 0 && errno != EAGAIN && errno != EINTR)
        {
            err = hal_sys_err(errno);
            close_line(board);
        }
        if (done <= 0)
        {
            break;
        }
        board->received_count += (size_t)done;
        parse_received(board);
    }
    return err;
}

static bool is_heard(const struct motors_uart *board)
{
    return board->was_heard && hal_clock_monotonic_us(&board->clock) - board->heard_us < HEARD_US;
}

// What it said last is old once it is heard no more: then it is gone, also while the robot drives.
static enum fw_err read_battery(void *device, int32_t *pack_mV)
{
    struct motors_uart *board = device;
    const enum fw_err err = receive(board);
    if (err == FW_OK && board->config.must_be_heard && board->was_heard && !is_heard(board))
    {
        return FW_ERR_NO_DEVICE;
    }
    if (err != FW_OK || !board->has_battery)
    {
        return err != FW_OK ? err : FW_ERR_TIMEOUT;
    }
    *pack_mV = board->pack_mV;
    return FW_OK;
}

static bool is_sending(const struct motors_uart *board)
{
    int unsent_bytes = 0;
    return ioctl(board->fd, TIOCOUTQ, &unsent_bytes) == 0 && unsent_bytes > 0;
}

// The board does not answer: it is enough that the frame has left and that the board is heard. A
// line takes bytes at once and sends them in its own time: half a millisecond, or some by USB.
static enum fw_err confirm(void *device)
{
    struct motors_uart *board = device;
    const enum fw_err err = receive(board);
    if (err != FW_OK || !board->config.must_be_heard)
    {
        return err;
    }
    bool is_late = false;
    for (int64_t left_us = board->config.retry_us; !is_late && is_sending(board);
         left_us -= RETRY_PAUSE_US)
    {
        is_late = left_us <= 0;
        hal_clock_wait(&board->clock, NULL, 0, RETRY_PAUSE_US);
    }
    return !is_late && is_heard(board) ? FW_OK : FW_ERR_TIMEOUT;
}

struct hal_motors motors_uart_make(struct motors_uart *board,
                                   const struct motors_uart_config *config,
                                   const struct hal_clock *clock)
{
    static const struct hal_motors_ops ops = {open_line, write_duties, stop, confirm, close_line};
    *board = (struct motors_uart){.config = *config, .clock = *clock, .fd = -1};
    return (struct hal_motors){.device = board, .ops = &ops};
}

struct hal_battery motors_uart_battery(struct motors_uart *board)
{
    static const struct hal_battery_ops ops = {read_battery};
    return (struct hal_battery){.device = board, .ops = &ops};
}

enum fw_err motors_uart_probe(struct motors_uart *board)
{
    const int64_t end_us = hal_clock_monotonic_us(&board->clock) + PROBE_US;
    enum fw_err err = receive(board);
    while (err == FW_OK && !is_heard(board) && hal_clock_monotonic_us(&board->clock) < end_us)
    {
        hal_clock_wait(&board->clock, &board->fd, 1,
                       end_us - hal_clock_monotonic_us(&board->clock));
        err = receive(board);
    }
    return err == FW_OK && !is_heard(board) ? FW_ERR_TIMEOUT : err;
}

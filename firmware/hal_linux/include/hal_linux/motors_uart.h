// SPDX-License-Identifier: Apache-2.0
// The Raspberry Pi 5 kit's board: frames over a serial line.
#ifndef HAL_LINUX_MOTORS_UART_H
#define HAL_LINUX_MOTORS_UART_H

#include <stdbool.h>

#include "hal/battery.h"
#include "hal/clock.h"
#include "hal/motors.h"

#define MOTORS_UART_FRAME_MAX 64

struct motors_uart_config
{
    const char *path;
    // As motors_i2c_config.
    int64_t retry_us;
    int8_t sign[FW_WHEEL_COUNT];
    // A stop is confirmed only while the board is heard. Without, when the line has taken it.
    bool must_be_heard;
};

// Only motors_uart.c looks inside.
struct motors_uart
{
    struct motors_uart_config config;
    struct hal_clock clock;
    int fd;
    // Frame that is arriving.
    uint8_t received[MOTORS_UART_FRAME_MAX];
    size_t received_count;
    // When the last whole frame of the board was read (monotonic), if there was any.
    bool was_heard;
    int64_t heard_us;
    bool has_battery;
    int32_t pack_mV;
};

// The line is opened at the first use, and again after a failure.
// @param board lives as long as the result. @param config its path is not copied.
struct hal_motors motors_uart_make(struct motors_uart *board,
                                   const struct motors_uart_config *config,
                                   const struct hal_clock *clock);

// What the board reported last of its own accord: FW_ERR_TIMEOUT until it has.
struct hal_battery motors_uart_battery(struct motors_uart *board);

// Tells whether a board is heard on the line: one whole frame of its reports, which it sends of its
// own accord. Writes nothing. Takes up to a second and a half.
// @return FW_OK, FW_ERR_TIMEOUT if the line is silent or speaks otherwise, FW_ERR_NO_DEVICE or
// FW_ERR_IO.
enum fw_err FW_MUST_CHECK motors_uart_probe(struct motors_uart *board);

#endif

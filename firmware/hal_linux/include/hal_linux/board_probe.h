// SPDX-License-Identifier: Apache-2.0
// Which of the two boards carries the motors.
#ifndef HAL_LINUX_BOARD_PROBE_H
#define HAL_LINUX_BOARD_PROBE_H

#include "hal_linux/motors_i2c.h"
#include "hal_linux/motors_uart.h"

enum board_kind
{
    BOARD_I2C,
    BOARD_UART,
};

// An answer at the I2C board's address decides for it, else a report of the other on its serial
// line: a line that opens is no answer.
// @param kind untouched on failure. @return FW_OK, or what the I2C board said if there is neither.
enum fw_err FW_MUST_CHECK board_probe(struct motors_i2c *i2c, struct motors_uart *uart,
                                      enum board_kind *kind);

#endif

// SPDX-License-Identifier: Apache-2.0
#include "hal_linux/board_probe.h"

enum fw_err board_probe(struct motors_i2c *i2c, struct motors_uart *uart, enum board_kind *kind)
{
    const enum fw_err err = motors_i2c_probe(i2c);
    if (err == FW_OK)
    {
        *kind = BOARD_I2C;
        return FW_OK;
    }
    if (motors_uart_probe(uart) == FW_OK)
    {
        *kind = BOARD_UART;
        return FW_OK;
    }
    return err;
}

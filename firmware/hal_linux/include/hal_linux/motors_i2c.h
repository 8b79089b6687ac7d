// SPDX-License-Identifier: Apache-2.0
// The Raspberry Pi 4 kit's board: one I2C slave with motors and battery behind 8-bit registers.
#ifndef HAL_LINUX_MOTORS_I2C_H
#define HAL_LINUX_MOTORS_I2C_H

#include <stdbool.h>

#include "hal/battery.h"
#include "hal/clock.h"
#include "hal/motors.h"
#include "hal_linux/sys.h"

#define MOTORS_I2C_ADDRESS 0x7A

struct motors_i2c_config
{
    const char *path;
    // One write of all four duties instead of four: half the bus time, if the board takes it.
    bool burst;
    // A refused transfer is tried again until this long after it was first tried.
    int64_t retry_us;
    // The motor registers can be read: a stop is confirmed when they are zero. Without, it is when
    // the board has acknowledged every byte of it.
    bool reads_back;
    // +1 or -1: the left wheels of the kit are mounted mirrored, so -1, 1, -1, 1.
    int8_t sign[FW_WHEEL_COUNT];
};

// Only motors_i2c.c looks inside.
struct motors_i2c
{
    struct motors_i2c_config config;
    struct hal_clock clock;
    const struct hal_sys *sys;
    int fd;
};

// The bus is opened at the first use, and again after a failure.
// @param board lives as long as the result. @param config its path is not copied.
struct hal_motors motors_i2c_make(struct motors_i2c *board, const struct motors_i2c_config *config,
                                  const struct hal_clock *clock, const struct hal_sys *sys);

// The battery of the same board.
struct hal_battery motors_i2c_battery(struct motors_i2c *board);

// Tells whether a board answers at its address with a voltage. Writes no duty.
// @return FW_OK, FW_ERR_NO_DEVICE, FW_ERR_TIMEOUT or FW_ERR_IO.
enum fw_err FW_MUST_CHECK motors_i2c_probe(struct motors_i2c *board);

#endif

// SPDX-License-Identifier: Apache-2.0
#include "hal_linux/motors_i2c.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/i2c-dev.h>
#include <string.h>

#define REGISTER_BATTERY 0x00
#define REGISTER_MOTOR 0x1F
// The kernel's wait for a stuck bus, in units of 10 ms; its own default is a second.
#define BUS_TIMEOUT_10MS 2
#define RETRY_PAUSE_US 500

static void close_bus(void *device)
{
    struct motors_i2c *board = device;
    if (board->fd >= 0)
    {
        (void)board->sys->close(board->fd);
        board->fd = -1;
    }
}

static enum fw_err open_bus(void *device)
{
    struct motors_i2c *board = device;
    if (board->fd >= 0)
    {
        return FW_OK;
    }
    board->fd = board->sys->open(board->config.path, O_RDWR);
    if (board->fd < 0)
    {
        return hal_sys_err(errno);
    }
    // Not every adapter takes a time-out: then its own holds.
    (void)board->sys->ioctl(board->fd, I2C_TIMEOUT, (void *)(uintptr_t)BUS_TIMEOUT_10MS);
    if (board->sys->ioctl(board->fd, I2C_SLAVE, (void *)(uintptr_t)MOTORS_I2C_ADDRESS) != 0)
    {
        const enum fw_err err = hal_sys_err(errno);
        close_bus(board);
        return err;
    }
    return FW_OK;
}

static enum fw_err result_of(ssize_t done, size_t count)
{
    return done == (ssize_t)count ? FW_OK : done < 0 ? hal_sys_err(errno) : FW_ERR_IO;
}

static enum fw_err send_once(struct motors_i2c *board, const uint8_t *bytes, size_t count)
{
    const enum fw_err err = open_bus(board);
    return err != FW_OK ? err : result_of(board->sys->write(board->fd, bytes, count), count);
}

// Tries until deadline_us, at least once, with pauses in which others run: those who watch this
// process, on a computer that has no second processor free. After the last failure the bus is
// closed, so that the next call opens whatever is there then.
static enum fw_err send_until(struct motors_i2c *board, const uint8_t *bytes, size_t count,
                              int64_t deadline_us)
{
    enum fw_err err = send_once(board, bytes, count);
    while (err != FW_OK && board->fd >= 0 && hal_clock_monotonic_us(&board->clock) < deadline_us)
    {
        hal_clock_wait(&board->clock, NULL, 0, RETRY_PAUSE_US);
        err = send_once(board, bytes, count);
    }
    if (err != FW_OK)
    {
        close_bus(board);
    }
    return err;
}

static int64_t deadline_us(const struct motors_i2c *board)
{
    return hal_clock_monotonic_us(&board->clock) + board->config.retry_us;
}

static uint8_t wire_duty(const struct motors_i2c *board, int wheel, int8_t duty_pct)
{
    return (uint8_t)(board->config.sign[wheel] * duty_pct);
}

// All four wheels share one deadline: a call lasts no longer than retry_us, a pause and one
// transfer.
static enum fw_err write_duties(void *device, const int8_t wheel_duty_pct[FW_WHEEL_COUNT])
{
    struct motors_i2c *board = device;
    const int64_t until_us = deadline_us(board);
    if (board->config.burst)
    {
        uint8_t bytes[1 + FW_WHEEL_COUNT] = {REGISTER_MOTOR};
        for (int wheel = 0; wheel < FW_WHEEL_COUNT; ++wheel)
        {
            bytes[1 + wheel] = wire_duty(board, wheel, wheel_duty_pct[wheel]);
        }
        return send_until(board, bytes, sizeof bytes, until_us);
    }
    for (int wheel = 0; wheel < FW_WHEEL_COUNT; ++wheel)
    {
        const uint8_t bytes[2] = {(uint8_t)(REGISTER_MOTOR + wheel),
                                  wire_duty(board, wheel, wheel_duty_pct[wheel])};
        const enum fw_err err = send_until(board, bytes, sizeof bytes, until_us);
        if (err != FW_OK)
        {
            return err;
        }
    }
    return FW_OK;
}

// Single writes whatever the configuration says: they need no auto-increment.
static enum fw_err stop(void *device)
{
    struct motors_i2c *board = device;
    const int64_t until_us = deadline_us(board);
    enum fw_err first_err = FW_OK;
    for (int wheel = 0; wheel < FW_WHEEL_COUNT; ++wheel)
    {
        const uint8_t bytes[2] = {(uint8_t)(REGISTER_MOTOR + wheel), 0};
        const enum fw_err err = send_until(board, bytes, sizeof bytes, until_us);
        first_err = first_err == FW_OK ? err : first_err;
    }
    return first_err;
}

// The board knows no repeated start: the register is chosen in one transfer and read in the next.
static enum fw_err read_register(struct motors_i2c *board, uint8_t chosen, uint8_t *bytes,
                                 size_t count)
{
    enum fw_err err = send_until(board, &chosen, sizeof chosen, deadline_us(board));
    if (err != FW_OK)
    {
        return err;
    }
    err = result_of(board->sys->read(board->fd, bytes, count), count);
    if (err != FW_OK)
    {
        close_bus(board);
    }
    return err;
}

// Another program may choose its own register between the two transfers: what is not zero is read
// once more.
static enum fw_err confirm_wheel(struct motors_i2c *board, int wheel)
{
    const uint8_t chosen = (uint8_t)(REGISTER_MOTOR + wheel);
    uint8_t duty = 0;
    enum fw_err err = read_register(board, chosen, &duty, sizeof duty);
    if (err == FW_OK && duty != 0)
    {
        err = read_register(board, chosen, &duty, sizeof duty);
    }
    return err == FW_OK && duty != 0 ? FW_ERR_NOT_ZERO : err;
}

static enum fw_err confirm(void *device)
{
    struct motors_i2c *board = device;
    enum fw_err err = FW_OK;
    for (int wheel = 0; err == FW_OK && board->config.reads_back && wheel < FW_WHEEL_COUNT; ++wheel)
    {
        err = confirm_wheel(board, wheel);
    }
    return err;
}

struct hal_motors motors_i2c_make(struct motors_i2c *board, const struct motors_i2c_config *config,
                                  const struct hal_clock *clock, const struct hal_sys *sys)
{
    static const struct hal_motors_ops ops = {open_bus, write_duties, stop, confirm, close_bus};
    *board = (struct motors_i2c){.config = *config, .clock = *clock, .sys = sys, .fd = -1};
    return (struct hal_motors){.device = board, .ops = &ops};
}

static enum fw_err read_battery(void *device, int32_t *pack_mV)
{
    uint8_t bytes[2];
    const enum fw_err err = read_register(device, REGISTER_BATTERY, bytes, sizeof bytes);
    if (err == FW_OK)
    {
        *pack_mV = bytes[0] + 256 * bytes[1];
    }
    return err;
}

struct hal_battery motors_i2c_battery(struct motors_i2c *board)
{
    static const struct hal_battery_ops ops = {read_battery};
    return (struct hal_battery){.device = board, .ops = &ops};
}

enum fw_err motors_i2c_probe(struct motors_i2c *board)
{
    int32_t pack_mV;
    return read_battery(board, &pack_mV);
}

// SPDX-License-Identifier: Apache-2.0
// Four wheel motors. A board keeps the last duty for ever: whoever writes one must stop it, too.
#ifndef HAL_MOTORS_H
#define HAL_MOTORS_H

#include <stdint.h>

#include "fw/err.h"
#include "fw/mixing.h"

#ifdef __cplusplus
extern "C" {
#endif

struct hal_motors_ops
{
    enum fw_err (*open)(void *device);
    enum fw_err (*write)(void *device, const int8_t wheel_duty_pct[FW_WHEEL_COUNT]);
    enum fw_err (*stop)(void *device);
    enum fw_err (*confirm)(void *device);
    void (*close)(void *device);
};

struct hal_motors
{
    void *device;
    const struct hal_motors_ops *ops;
};

// Takes the bus, as every other call does by itself: who has it can stop the wheels though no file
// can be opened any more. @return FW_OK, or as hal_motors_write().
static inline enum fw_err hal_motors_open(const struct hal_motors *motors)
{
    return motors->ops->open(motors->device);
}

// Hands four duties to the board; the driver applies the sign of each channel.
// @param wheel_duty_pct order of fw_wheel, [-100, 100], positive drives the robot forward.
// @return FW_OK, FW_ERR_NO_DEVICE, FW_ERR_IO or FW_ERR_TIMEOUT; then some wheels may have theirs.
static inline enum fw_err FW_MUST_CHECK
hal_motors_write(const struct hal_motors *motors, const int8_t wheel_duty_pct[FW_WHEEL_COUNT])
{
    return motors->ops->write(motors->device, wheel_duty_pct);
}

// Zero to every wheel, each tried even if another fails. Allocates nothing, may be called any time.
// @return FW_OK if every wheel took it, else as hal_motors_write(): call it again.
static inline enum fw_err FW_MUST_CHECK hal_motors_stop(const struct hal_motors *motors)
{
    return motors->ops->stop(motors->device);
}

// Asks the board whether the wheels have been told to stand; what it answers by is the driver's.
// @return FW_OK if it says so, FW_ERR_NOT_ZERO if it says otherwise, FW_ERR_TIMEOUT if it says
// nothing, or as hal_motors_write().
static inline enum fw_err FW_MUST_CHECK hal_motors_confirm(const struct hal_motors *motors)
{
    return motors->ops->confirm(motors->device);
}

// Gives the bus back; the duties stay as they are.
static inline void hal_motors_close(const struct hal_motors *motors)
{
    motors->ops->close(motors->device);
}

#ifdef __cplusplus
}
#endif

#endif

// SPDX-License-Identifier: Apache-2.0
// Time, and waiting for something to happen.
#ifndef HAL_CLOCK_H
#define HAL_CLOCK_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

struct hal_clock_ops
{
    int64_t (*monotonic_us)(void *device);
    int64_t (*unix_us)(void *device);
    void (*wait)(void *device, const int *fds, size_t count, int64_t timeout_us);
};

struct hal_clock
{
    void *device;
    const struct hal_clock_ops *ops;
};

// The clock of camera frames: never set, starts anywhere.
static inline int64_t hal_clock_monotonic_us(const struct hal_clock *clock)
{
    return clock->ops->monotonic_us(clock->device);
}

// Since the Unix epoch; may jump when the network sets it.
static inline int64_t hal_clock_unix_us(const struct hal_clock *clock)
{
    return clock->ops->unix_us(clock->device);
}

// Returns when a descriptor is readable or in error, when a signal comes, or after the time-out.
// @param fds negative ones are skipped; @param count at most HAL_WAIT_MAX.
#define HAL_WAIT_MAX 8
static inline void hal_clock_wait(const struct hal_clock *clock, const int *fds, size_t count,
                                  int64_t timeout_us)
{
    clock->ops->wait(clock->device, fds, count, timeout_us);
}

#ifdef __cplusplus
}
#endif

#endif

// SPDX-License-Identifier: Apache-2.0
#include "hal_linux/clock_linux.h"

#include <poll.h>
#include <time.h>

static int64_t read_clock_us(clockid_t id)
{
    struct timespec now;
    clock_gettime(id, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

static int64_t monotonic_us(void *device)
{
    (void)device;
    return read_clock_us(CLOCK_MONOTONIC);
}

static int64_t unix_us(void *device)
{
    (void)device;
    return read_clock_us(CLOCK_REALTIME);
}

static void wait_for(void *device, const int *fds, size_t count, int64_t timeout_us)
{
    (void)device;
    struct pollfd polled[HAL_WAIT_MAX];
    for (size_t i = 0; i < count; ++i)
    {
        polled[i] = (struct pollfd){.fd = fds[i], .events = POLLIN};
    }
    const struct timespec timeout = {.tv_sec = timeout_us / 1000000,
                                     .tv_nsec = timeout_us % 1000000 * 1000};
    // Whatever it answers, the caller looks at every device and at the time.
    (void)ppoll(polled, (nfds_t)count, &timeout, NULL);
}

struct hal_clock clock_linux(void)
{
    static const struct hal_clock_ops ops = {monotonic_us, unix_us, wait_for};
    return (struct hal_clock){.device = NULL, .ops = &ops};
}

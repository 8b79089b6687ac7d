// SPDX-License-Identifier: Apache-2.0
#include "hal_stub/stub_clock.h"

static int64_t monotonic_us(void *device)
{
    return ((const struct stub_clock *)device)->monotonic_us;
}

static int64_t unix_us(void *device)
{
    const struct stub_clock *clock = device;
    return clock->monotonic_us + clock->unix_offset_us;
}

static void wait_for(void *device, const int *fds, size_t count, int64_t timeout_us)
{
    (void)fds;
    (void)count;
    struct stub_clock *clock = device;
    clock->monotonic_us += timeout_us < clock->wait_us ? timeout_us : clock->wait_us;
}

struct hal_clock stub_clock_make(struct stub_clock *clock)
{
    static const struct hal_clock_ops ops = {monotonic_us, unix_us, wait_for};
    return (struct hal_clock){.device = clock, .ops = &ops};
}

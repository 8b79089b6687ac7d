// SPDX-License-Identifier: Apache-2.0
// A clock that a test moves by hand.
#ifndef HAL_STUB_STUB_CLOCK_H
#define HAL_STUB_STUB_CLOCK_H

#include "hal/clock.h"

struct stub_clock
{
    int64_t monotonic_us;
    // Unix time less monotonic time.
    int64_t unix_offset_us;
    // Waiting lasts this long, or the time-out if that is shorter.
    int64_t wait_us;
};

// @param clock lives as long as the result.
struct hal_clock stub_clock_make(struct stub_clock *clock);

#endif

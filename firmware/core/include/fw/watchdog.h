// SPDX-License-Identifier: Apache-2.0
// The two limits on motion: no fresh frame means stop, and no duty passes the cap.
#ifndef FW_WATCHDOG_H
#define FW_WATCHDOG_H

#include <stdbool.h>
#include <stdint.h>

#include "fw/mixing.h"

#ifdef __cplusplus
extern "C" {
#endif

// @return true if the frame is older than the time-out, or if it is from the future.
bool fw_watchdog_expired(int64_t frame_utime_us, int64_t now_us, int64_t timeout_us);

// Clamps each duty to [-cap_pct, cap_pct], independently like the mixing.
// @param cap_pct [0, 100]
// @return true if any duty changed.
bool fw_duty_cap(int8_t wheel_duty_pct[FW_WHEEL_COUNT], int32_t cap_pct);

#ifdef __cplusplus
}
#endif

#endif

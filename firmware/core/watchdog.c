// SPDX-License-Identifier: Apache-2.0
#include "fw/watchdog.h"

bool fw_watchdog_expired(int64_t frame_utime_us, int64_t now_us, int64_t timeout_us)
{
    if (frame_utime_us > now_us)
    {
        return true;
    }
    // The true age fits an unsigned number whatever the two times are.
    return (uint64_t)now_us - (uint64_t)frame_utime_us > (uint64_t)timeout_us;
}

bool fw_duty_cap(int8_t wheel_duty_pct[FW_WHEEL_COUNT], int32_t cap_pct)
{
    bool capped = false;
    for (int i = 0; i < FW_WHEEL_COUNT; ++i)
    {
        if (wheel_duty_pct[i] > cap_pct)
        {
            wheel_duty_pct[i] = (int8_t)cap_pct;
            capped = true;
        }
        else if (wheel_duty_pct[i] < -cap_pct)
        {
            wheel_duty_pct[i] = (int8_t)-cap_pct;
            capped = true;
        }
    }
    return capped;
}

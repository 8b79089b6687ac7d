// SPDX-License-Identifier: Apache-2.0
#include "fw/mixing.h"

// The vendor computes v sin(d) -+ w (a + b) in floating point and truncates with int(). In whole
// thousandths of a duty point the same sum is exact, and C's division truncates the same way. So
// straight back at 50, where the vendor's cos(270 deg) of -2e-16 gives -50 -49 -49 -50, is -50 on
// all four wheels here.
static int8_t side_duty_pct(int64_t speed_pct, int64_t turn_milli)
{
    const int64_t duty_pct = (1000 * speed_pct + FW_TURN_LEVER_PCT * turn_milli) / 1000;
    if (duty_pct > FW_DUTY_MAX_PCT)
    {
        return FW_DUTY_MAX_PCT;
    }
    return duty_pct < -FW_DUTY_MAX_PCT ? -FW_DUTY_MAX_PCT : (int8_t)duty_pct;
}

void fw_mix(const struct fw_input *input, int8_t wheel_duty_pct[FW_WHEEL_COUNT])
{
    const int64_t turn_milli = input->turn_input_milli;
    const int8_t left_pct = side_duty_pct(input->speed_input_pct, -turn_milli);
    const int8_t right_pct = side_duty_pct(input->speed_input_pct, turn_milli);
    wheel_duty_pct[FW_FRONT_LEFT] = wheel_duty_pct[FW_REAR_LEFT] = left_pct;
    wheel_duty_pct[FW_FRONT_RIGHT] = wheel_duty_pct[FW_REAR_RIGHT] = right_pct;
}

// SPDX-License-Identifier: Apache-2.0
// Speed and turn input to four wheel duties: the vendor's mecanum mixing without its sideways part.
#ifndef FW_MIXING_H
#define FW_MIXING_H

#include <stdint.h>

#include "fw/table.h"

#ifdef __cplusplus
extern "C" {
#endif

enum fw_wheel
{
    FW_FRONT_LEFT = 0,
    FW_FRONT_RIGHT,
    FW_REAR_LEFT,
    FW_REAR_RIGHT,
    FW_WHEEL_COUNT,
};

#define FW_DUTY_MAX_PCT 100
// Duty points that a turn input of 1 takes from one side and gives to the other: a + b = 67 + 59.
#define FW_TURN_LEVER_PCT 126

// left = trunc(speed - 126 turn), right = trunc(speed + 126 turn), each clamped to [-100, 100].
// The vendor's turn is positive clockwise, ours counter-clockwise; here alone the sign changes.
// @param wheel_duty_pct written in the order of fw_wheel, positive drives the robot forward.
void fw_mix(const struct fw_input *input, int8_t wheel_duty_pct[FW_WHEEL_COUNT]);

#ifdef __cplusplus
}
#endif

#endif

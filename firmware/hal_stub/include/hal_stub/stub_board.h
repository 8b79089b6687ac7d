// SPDX-License-Identifier: Apache-2.0
// A motor board that remembers what it was told, and a battery of any voltage.
#ifndef HAL_STUB_STUB_BOARD_H
#define HAL_STUB_STUB_BOARD_H

#include <stdbool.h>

#include "hal/battery.h"
#include "hal/clock.h"
#include "hal/motors.h"
#include "hal_stub/stub_camera.h"
#include "hal_stub/stub_faults.h"

struct stub_board
{
    struct stub_faults *faults;
    // Every duty written is appended here as a line `t_us,fl,fr,rl,rr`, t_us by the monotonic
    // clock; NULL: not recorded.
    const char *record_path;
    struct hal_clock clock;
    // Every duty written is also sent back through this camera's socket, as 8 bytes: how many
    // frames it has given out so far (little endian), then fl,fr,rl,rr in percent. A program that
    // sends frames thus knows which of them decided. NULL: not sent.
    const struct stub_camera *answers_to;
    // The record's file, if it is open.
    bool is_open;
    int fd;
    // As on the real board: what was written last stays.
    int8_t wheel_duty_pct[FW_WHEEL_COUNT];
    // Calls that succeeded, and calls of stop that were tried.
    int32_t write_count, stop_count, stop_try_count;
    int32_t pack_mV;
};

// @param board lives as long as the result.
struct hal_motors stub_board_motors(struct stub_board *board);
struct hal_battery stub_board_battery(struct stub_board *board);

#endif

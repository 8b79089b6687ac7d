// SPDX-License-Identifier: Apache-2.0
// An input script: what the wheels are told over time, whatever the sensor sees.
#ifndef FW_SCRIPT_H
#define FW_SCRIPT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fw/mixing.h"
#include "fw/table.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fw_script_row
{
    // Since the script's start.
    int64_t t_us;
    // If the script has inputs.
    struct fw_input input;
    // If it has duties.
    int8_t wheel_duty_pct[FW_WHEEL_COUNT];
};

struct fw_script
{
    // Storage of the caller.
    struct fw_script_row *rows;
    int32_t capacity;
    int32_t row_count;
    bool has_duties;
};

// Why a text is no script.
enum fw_script_fault
{
    FW_SCRIPT_OK = 0,
    FW_SCRIPT_HEADER,
    FW_SCRIPT_NO_ROWS,
    FW_SCRIPT_TOO_LONG,
    FW_SCRIPT_COLUMNS,
    FW_SCRIPT_NUMBER,
    FW_SCRIPT_ORDER,
    FW_SCRIPT_INPUT_RANGE,
    FW_SCRIPT_DUTY_RANGE,
};

// What is wrong and what would be right, as the end of a sentence. Never NULL.
const char *fw_script_fault_str(enum fw_script_fault fault);

// Reads CSV with the header t_s,speed_input,turn_input or t_s,fl_pct,fr_pct,rl_pct,rr_pct and
// decimal numbers, times rising. Times are rounded to microseconds, speed and duties to whole
// percent, turn to thousandths. Lines end in LF or CRLF; empty ones are skipped.
// @param text need not end in 0.
// @param script rows and capacity are set by the caller, the rest by this function.
// @param line on failure: of the fault, counted from 1.
enum fw_script_fault fw_script_parse(const char *text, size_t length, struct fw_script *script,
                                     int32_t *line);

// @return the row held at t_us; NULL before the first.
const struct fw_script_row *fw_script_at(const struct fw_script *script, int64_t t_us);

// @return when the row after the one at t_us begins; INT64_MAX if there is none.
int64_t fw_script_next_us(const struct fw_script *script, int64_t t_us);

#ifdef __cplusplus
}
#endif

#endif

// SPDX-License-Identifier: Apache-2.0
// The whole controller: one bit chooses one of two inputs.
#ifndef FW_TABLE_H
#define FW_TABLE_H

#include <stdbool.h>
#include <stdint.h>

#include "fw/err.h"

#ifdef __cplusplus
extern "C" {
#endif

#define FW_SPEED_INPUT_MAX_PCT 100
#define FW_TURN_INPUT_MAX_MILLI 2000

struct fw_input
{
    // [-100, 100], positive forward.
    int32_t speed_input_pct;
    // [-2000, 2000], positive counter-clockwise (left); 1000 is a turn input of 1.
    int32_t turn_input_milli;
};

struct fw_table
{
    struct fw_input unseen;
    struct fw_input seen;
};

// @return FW_OK or FW_ERR_INPUT_RANGE; a table is in range if both inputs are.
enum fw_err FW_MUST_CHECK fw_input_check(const struct fw_input *input);
enum fw_err FW_MUST_CHECK fw_table_check(const struct fw_table *table);

// Reads "unseen speed,unseen turn,seen speed,seen turn" in inputs, as in 100,-0.5,100,0.5.
// @return false, and table untouched, if the text is none or its table is out of range.
bool fw_table_parse(const char *text, struct fw_table *table);

// Takes the row that the bit selects.
struct fw_input fw_table_lookup(const struct fw_table *table, bool detected);

#ifdef __cplusplus
}
#endif

#endif

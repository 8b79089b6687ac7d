// SPDX-License-Identifier: Apache-2.0
// The whole controller: k bits choose one of 2^k inputs.
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
#define FW_MAX_BITS 4
#define FW_MAX_ROWS (1 << FW_MAX_BITS)

struct fw_input
{
    // [-100, 100], positive forward.
    int16_t speed_input_pct;
    // [-2000, 2000], positive counter-clockwise (left); 1000 is a turn input of 1.
    int16_t turn_input_milli;
};

struct fw_table
{
    // k, [1, FW_MAX_BITS]
    uint8_t bit_count;
    // The first 2^k count. The row of bits is that of their number: bit 1 is worth 1, bit 2 is
    // worth 2, bit 3 is worth 4.
    struct fw_input rows[FW_MAX_ROWS];
};

// @return FW_OK or FW_ERR_INPUT_RANGE.
enum fw_err FW_MUST_CHECK fw_input_check(const struct fw_input *input);
// @return FW_OK, FW_ERR_BITS for the number of rows, or FW_ERR_INPUT_RANGE for one of them.
enum fw_err FW_MUST_CHECK fw_table_check(const struct fw_table *table);

int fw_table_row_count(const struct fw_table *table);

// Reads the rows, speed and turn input each, as in 100,-0.5,100,0.5 for nothing seen and for seen.
// @return false, and table untouched, if the text is none or its table is out of range.
bool fw_table_parse(const char *text, struct fw_table *table);

// Takes the row of the bits; those that the table does not know of do not matter.
struct fw_input fw_table_lookup(const struct fw_table *table, uint32_t bits);

#ifdef __cplusplus
}
#endif

#endif

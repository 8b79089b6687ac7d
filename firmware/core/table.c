// SPDX-License-Identifier: Apache-2.0
#include "fw/table.h"

#include "decimal.h"

enum fw_err fw_input_check(const struct fw_input *input)
{
    if (input->speed_input_pct < -FW_SPEED_INPUT_MAX_PCT ||
        input->speed_input_pct > FW_SPEED_INPUT_MAX_PCT ||
        input->turn_input_milli < -FW_TURN_INPUT_MAX_MILLI ||
        input->turn_input_milli > FW_TURN_INPUT_MAX_MILLI)
    {
        return FW_ERR_INPUT_RANGE;
    }
    return FW_OK;
}

int fw_table_row_count(const struct fw_table *table)
{
    return 1 << table->bit_count;
}

enum fw_err fw_table_check(const struct fw_table *table)
{
    if (table->bit_count < 1 || table->bit_count > FW_MAX_BITS)
    {
        return FW_ERR_BITS;
    }
    enum fw_err err = FW_OK;
    for (int row = 0; err == FW_OK && row < fw_table_row_count(table); ++row)
    {
        err = fw_input_check(&table->rows[row]);
    }
    return err;
}

bool fw_table_parse(const char *text, struct fw_table *table)
{
    // A speed is a whole number of percent, a turn one of thousandths.
    static const int places[] = {0, 3};
    int64_t values[2 * FW_MAX_ROWS];
    const int count = fw_decimal_list(text, places, values, 2 * FW_MAX_ROWS);
    struct fw_table parsed = {0};
    for (int i = 0; i < count; ++i)
    {
        if (values[i] < INT16_MIN || values[i] > INT16_MAX)
        {
            return false;
        }
        struct fw_input *row = &parsed.rows[i / 2];
        *(i % 2 == 0 ? &row->speed_input_pct : &row->turn_input_milli) = (int16_t)values[i];
    }
    while (2 * fw_table_row_count(&parsed) < count)
    {
        ++parsed.bit_count;
    }
    if (2 * fw_table_row_count(&parsed) != count || fw_table_check(&parsed) != FW_OK)
    {
        return false;
    }
    *table = parsed;
    return true;
}

struct fw_input fw_table_lookup(const struct fw_table *table, uint32_t bits)
{
    return table->rows[bits & ((uint32_t)fw_table_row_count(table) - 1)];
}

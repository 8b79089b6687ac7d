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

enum fw_err fw_table_check(const struct fw_table *table)
{
    const enum fw_err err = fw_input_check(&table->unseen);
    return err != FW_OK ? err : fw_input_check(&table->seen);
}

static size_t until_comma(const char *text)
{
    size_t length = 0;
    while (text[length] != '\0' && text[length] != ',')
    {
        ++length;
    }
    return length;
}

bool fw_table_parse(const char *text, struct fw_table *table)
{
    int32_t values[4];
    for (int i = 0; i < 4; ++i)
    {
        const size_t length = until_comma(text);
        int64_t value;
        // A speed is a whole number of percent, a turn one of thousandths.
        if (text[length] != (i < 3 ? ',' : '\0') ||
            !fw_decimal_parse(text, length, i % 2 == 0 ? 0 : 3, &value) || value < INT32_MIN ||
            value > INT32_MAX)
        {
            return false;
        }
        values[i] = (int32_t)value;
        text += length + (i < 3);
    }
    const struct fw_table parsed = {{values[0], values[1]}, {values[2], values[3]}};
    if (fw_table_check(&parsed) != FW_OK)
    {
        return false;
    }
    *table = parsed;
    return true;
}

struct fw_input fw_table_lookup(const struct fw_table *table, bool detected)
{
    return detected ? table->seen : table->unseen;
}

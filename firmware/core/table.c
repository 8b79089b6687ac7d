// SPDX-License-Identifier: Apache-2.0
#include "fw/table.h"

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

struct fw_input fw_table_lookup(const struct fw_table *table, bool detected)
{
    return detected ? table->seen : table->unseen;
}

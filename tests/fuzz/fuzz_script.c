// SPDX-License-Identifier: Apache-2.0
// Any text as an input script: refused with a line that it has, or rows in range and in order.
#include "fuzz.h"
#include "fw/script.h"

#define ROWS 16

static void check_row(const struct fw_script *script, int32_t i)
{
    const struct fw_script_row *row = &script->rows[i];
    CLAIM(i == 0 || row->t_us > row[-1].t_us);
    CLAIM(fw_script_at(script, row->t_us) == row);
    CLAIM(fw_script_next_us(script, row->t_us) ==
          (i + 1 < script->row_count ? row[1].t_us : INT64_MAX));
    CLAIM(fw_input_check(&row->input) == FW_OK);
    for (int wheel = 0; wheel < FW_WHEEL_COUNT; ++wheel)
    {
        CLAIM(abs(row->wheel_duty_pct[wheel]) <= FW_DUTY_MAX_PCT);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const headers[] = {"", "t_s,speed_input,turn_input\n",
                                          "t_s,fl_pct,fr_pct,rl_pct,rr_pct\n"};
    struct bytes in = {data, size};
    const char *header = headers[take(&in, 1) % 3];
    const size_t length = strlen(header) + in.left;
    char *text = malloc(length > 0 ? length : 1);
    CLAIM(text != NULL);
    memcpy(text, header, strlen(header));
    memcpy(text + strlen(header), in.next, in.left);
    struct fw_script_row rows[ROWS];
    struct fw_script script = {.rows = rows, .capacity = ROWS};
    int32_t line = 0;
    const enum fw_script_fault fault = fw_script_parse(text, length, &script, &line);
    CLAIM(script.row_count >= 0 && script.row_count <= ROWS);
    CLAIM(line >= 1 && (size_t)line <= length + 1);
    for (int32_t i = 0; fault == FW_SCRIPT_OK && i < script.row_count; ++i)
    {
        check_row(&script, i);
    }
    CLAIM(fault != FW_SCRIPT_OK || script.row_count > 0);
    free(text);
    return 0;
}

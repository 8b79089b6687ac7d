// SPDX-License-Identifier: Apache-2.0
#include "fw/script.h"

#include <string.h>

#include "decimal.h"

#define MAX_COLUMNS 5
// Ranges are checked before rounding, in thousandths.
#define PLACES 3
#define THOUSAND 1000

static const char input_header[] = "t_s,speed_input,turn_input";
static const char duty_header[] = "t_s,fl_pct,fr_pct,rl_pct,rr_pct";

const char *fw_script_fault_str(enum fw_script_fault fault)
{
    switch (fault)
    {
        case FW_SCRIPT_OK: return "ok";
        case FW_SCRIPT_HEADER:
            return "the header must be t_s,speed_input,turn_input or "
                   "t_s,fl_pct,fr_pct,rl_pct,rr_pct";
        case FW_SCRIPT_NO_ROWS: return "the script has no rows";
        case FW_SCRIPT_TOO_LONG: return "the script has more rows than there is room for";
        case FW_SCRIPT_COLUMNS: return "the row has not as many columns as the header";
        case FW_SCRIPT_NUMBER: return "a column holds no number";
        case FW_SCRIPT_ORDER: return "t_s must be later than in the row before";
        case FW_SCRIPT_INPUT_RANGE:
            return "speed_input must be within -100..100 and turn_input within -2..2";
        case FW_SCRIPT_DUTY_RANGE: return "duties must be within -100..100 percent";
    }
    return "unknown fault";
}

struct line
{
    const char *text;
    size_t length;
};

// Takes the next line, without its end. @return false if the text is over.
static bool next_line(const char **text, const char *end, struct line *line)
{
    if (*text == end)
    {
        return false;
    }
    const char *begin = *text;
    const char *stop = begin;
    while (stop < end && *stop != '\n')
    {
        ++stop;
    }
    *text = stop < end ? stop + 1 : end;
    const bool has_return = stop > begin && stop[-1] == '\r';
    *line = (struct line){begin, (size_t)(stop - begin) - has_return};
    return true;
}

static bool equals(const struct line *line, const char *text)
{
    return line->length == strlen(text) && memcmp(line->text, text, line->length) == 0;
}

// The time in microseconds, then the other columns in thousandths.
static enum fw_script_fault read_columns(const struct line *line, int count,
                                         int64_t values[MAX_COLUMNS])
{
    const char *begin = line->text;
    const char *end = line->text + line->length;
    for (int column = 0; column < count; ++column)
    {
        const char *stop = begin;
        while (stop < end && *stop != ',')
        {
            ++stop;
        }
        if ((stop == end) != (column == count - 1))
        {
            return FW_SCRIPT_COLUMNS;
        }
        if (!fw_decimal_parse(begin, (size_t)(stop - begin), column == 0 ? 6 : PLACES,
                              &values[column]))
        {
            return FW_SCRIPT_NUMBER;
        }
        begin = stop < end ? stop + 1 : end;
    }
    return FW_SCRIPT_OK;
}

static bool within(int64_t value, int64_t limit)
{
    return value >= -limit && value <= limit;
}

static enum fw_script_fault fill_row(bool has_duties, const int64_t values[MAX_COLUMNS],
                                     struct fw_script_row *row)
{
    *row = (struct fw_script_row){.t_us = values[0]};
    if (!has_duties)
    {
        if (!within(values[1], FW_SPEED_INPUT_MAX_PCT * THOUSAND) ||
            !within(values[2], FW_TURN_INPUT_MAX_MILLI))
        {
            return FW_SCRIPT_INPUT_RANGE;
        }
        row->input.speed_input_pct = (int16_t)fw_decimal_round(values[1], PLACES);
        row->input.turn_input_milli = (int16_t)values[2];
        return FW_SCRIPT_OK;
    }
    for (int wheel = 0; wheel < FW_WHEEL_COUNT; ++wheel)
    {
        if (!within(values[1 + wheel], FW_DUTY_MAX_PCT * THOUSAND))
        {
            return FW_SCRIPT_DUTY_RANGE;
        }
        row->wheel_duty_pct[wheel] = (int8_t)fw_decimal_round(values[1 + wheel], PLACES);
    }
    return FW_SCRIPT_OK;
}

static enum fw_script_fault add_row(struct fw_script *script, const struct line *line)
{
    if (script->row_count == script->capacity)
    {
        return FW_SCRIPT_TOO_LONG;
    }
    int64_t values[MAX_COLUMNS];
    struct fw_script_row *row = &script->rows[script->row_count];
    enum fw_script_fault fault = read_columns(line, script->has_duties ? 5 : 3, values);
    if (fault == FW_SCRIPT_OK)
    {
        fault = fill_row(script->has_duties, values, row);
    }
    if (fault == FW_SCRIPT_OK && script->row_count > 0 && row->t_us <= row[-1].t_us)
    {
        fault = FW_SCRIPT_ORDER;
    }
    script->row_count += fault == FW_SCRIPT_OK;
    return fault;
}

enum fw_script_fault fw_script_parse(const char *text, size_t length, struct fw_script *script,
                                     int32_t *line_number)
{
    const char *end = text + length;
    struct line line;
    script->row_count = 0;
    *line_number = 1;
    if (!next_line(&text, end, &line))
    {
        return FW_SCRIPT_HEADER;
    }
    script->has_duties = equals(&line, duty_header);
    if (!script->has_duties && !equals(&line, input_header))
    {
        return FW_SCRIPT_HEADER;
    }
    while (next_line(&text, end, &line))
    {
        ++*line_number;
        const enum fw_script_fault fault = line.length == 0 ? FW_SCRIPT_OK : add_row(script, &line);
        if (fault != FW_SCRIPT_OK)
        {
            return fault;
        }
    }
    return script->row_count > 0 ? FW_SCRIPT_OK : FW_SCRIPT_NO_ROWS;
}

// Rows that have begun at t_us.
static int32_t begun_count(const struct fw_script *script, int64_t t_us)
{
    int32_t low = 0, high = script->row_count;
    while (low < high)
    {
        const int32_t middle = low + (high - low) / 2;
        if (script->rows[middle].t_us <= t_us)
        {
            low = middle + 1;
        }
        else
        {
            high = middle;
        }
    }
    return low;
}

const struct fw_script_row *fw_script_at(const struct fw_script *script, int64_t t_us)
{
    const int32_t count = begun_count(script, t_us);
    return count > 0 ? &script->rows[count - 1] : NULL;
}

int64_t fw_script_next_us(const struct fw_script *script, int64_t t_us)
{
    const int32_t count = begun_count(script, t_us);
    return count < script->row_count ? script->rows[count].t_us : INT64_MAX;
}

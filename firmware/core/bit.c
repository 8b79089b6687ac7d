// SPDX-License-Identifier: Apache-2.0
#include "fw/bit.h"

#include <string.h>

#include "decimal.h"

struct fw_bit fw_bit_default(void)
{
    return (struct fw_bit){
        .box = fw_color_box_green(), .min_blob_px = 300, .vote = fw_vote_config_default()};
}

enum fw_err fw_bit_check(const struct fw_bit *bit)
{
    const struct fw_color_box *box = &bit->box;
    if (box->y_min > box->y_max || box->u_min > box->u_max || box->v_min > box->v_max)
    {
        return FW_ERR_BOX;
    }
    if (bit->min_blob_px < 0)
    {
        return FW_ERR_MIN_BLOB;
    }
    return bit->sector < FW_SECTOR_COUNT ? fw_vote_check(&bit->vote) : FW_ERR_BITS;
}

// Numbers in the order of the text.
enum
{
    MIN_BLOB = sizeof(struct fw_color_box),
    VOTE_FRAMES,
    VOTE_WINDOW,
    NUMBER_COUNT,
};

static bool set_numbers(struct fw_bit *bit, const int64_t *values, int count)
{
    for (int i = 0; i < count; ++i)
    {
        if (values[i] < 0 || values[i] > (i < MIN_BLOB ? UINT8_MAX : INT32_MAX))
        {
            return false;
        }
    }
    uint8_t box[MIN_BLOB];
    memcpy(box, &bit->box, sizeof box);
    for (int i = 0; i < count && i < MIN_BLOB; ++i)
    {
        box[i] = (uint8_t)values[i];
    }
    memcpy(&bit->box, box, sizeof box);
    if (count > MIN_BLOB)
    {
        bit->min_blob_px = (int32_t)values[MIN_BLOB];
    }
    if (count > VOTE_FRAMES)
    {
        bit->vote.max_frames = (int32_t)values[VOTE_FRAMES];
    }
    if (count > VOTE_WINDOW)
    {
        bit->vote.window_us = fw_vote_window_us(values[VOTE_WINDOW]);
    }
    return true;
}

bool fw_bit_parse(const char *text, struct fw_bit *bit)
{
    static const char sectors[FW_SECTOR_COUNT][6] = {"all", "left", "right"};
    static const int places[] = {0, 0};
    const size_t length = strcspn(text, ",");
    struct fw_bit parsed = *bit;
    parsed.sector = 0;
    while (parsed.sector < FW_SECTOR_COUNT && (strlen(sectors[parsed.sector]) != length ||
                                               memcmp(sectors[parsed.sector], text, length) != 0))
    {
        ++parsed.sector;
    }
    int64_t values[NUMBER_COUNT];
    const bool has_numbers = text[length] != '\0';
    const int count =
        has_numbers ? fw_decimal_list(text + length + 1, places, values, NUMBER_COUNT) : 0;
    if ((has_numbers && count == 0) || !set_numbers(&parsed, values, count) ||
        fw_bit_check(&parsed) != FW_OK)
    {
        return false;
    }
    *bit = parsed;
    return true;
}

static void look_for(int min, int max, int number, uint8_t entries[16])
{
    for (int i = min >> 4; i <= max >> 4; ++i)
    {
        entries[i] |= (uint8_t)(1 << number);
    }
}

void fw_bit_look_for(const struct fw_bit *bit, int number, struct fw_looks *looks)
{
    look_for(bit->box.u_min, bit->box.u_max, number, looks->u);
    look_for(bit->box.v_min, bit->box.v_max, number, looks->v);
}

void fw_bit_columns(const struct fw_bit *bit, int width_px, int *begin_px, int *end_px)
{
    const int middle_px = width_px / 2 & ~1;
    *begin_px = bit->sector == FW_SECTOR_RIGHT ? middle_px : 0;
    *end_px = bit->sector == FW_SECTOR_LEFT ? middle_px : width_px;
}

// SPDX-License-Identifier: Apache-2.0
// One bit of what a robot sees: a colour in a sector of the picture, put to a vote of its own.
#ifndef FW_BIT_H
#define FW_BIT_H

#include <stdbool.h>
#include <stdint.h>

#include "fw/err.h"
#include "fw/threshold.h"
#include "fw/vote.h"

#ifdef __cplusplus
extern "C" {
#endif

// Half pictures are cut at their middle, or a pixel left of it: two neighbours share a colour.
enum fw_sector
{
    FW_SECTOR_ALL = 0,
    FW_SECTOR_LEFT,
    FW_SECTOR_RIGHT,
    FW_SECTOR_COUNT,
};

struct fw_bit
{
    struct fw_color_box box;
    // One of fw_sector.
    uint8_t sector;
    // A frame sets the bit if the sector's largest blob has more pixels than this. >= 0
    int32_t min_blob_px;
    struct fw_vote_config vote;
};

// Green anywhere, blob > 300 px, 6 of 10 frames.
struct fw_bit fw_bit_default(void);

// @return FW_OK, or the code of an entry that is out of range.
enum fw_err FW_MUST_CHECK fw_bit_check(const struct fw_bit *bit);

// Reads a sector (all, left or right) and up to nine whole numbers, as in left,40,235,0,124,0,108:
// y_min, y_max, u_min, u_max, v_min, v_max, min_blob_px, frames of the vote, its window in ms (0:
// of any age). What is left out of them stays as it is.
// @return false, and bit untouched, if the text is none or its bit is out of range.
bool fw_bit_parse(const char *text, struct fw_bit *bit);

// Makes the quick look for several boxes look for this one, too. @param number [0, 7].
void fw_bit_look_for(const struct fw_bit *bit, int number, struct fw_looks *looks);

// The sector of a picture of this width: [begin_px, end_px), both even.
void fw_bit_columns(const struct fw_bit *bit, int width_px, int *begin_px, int *end_px);

#ifdef __cplusplus
}
#endif

#endif

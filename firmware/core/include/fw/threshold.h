// SPDX-License-Identifier: Apache-2.0
// Which pixels have the target's colour: one row of YUYV bytes in, one bit per pixel out.
#ifndef FW_THRESHOLD_H
#define FW_THRESHOLD_H

#include <stdbool.h>
#include <stdint.h>

#include "fw/frame.h"

#ifdef __cplusplus
extern "C" {
#endif

#define FW_MASK_WORD_PX 32
#define FW_MASK_WORDS (FW_MAX_WIDTH_PX / FW_MASK_WORD_PX)

// Limits of the colour, both ends included; BT.601 studio range as cameras send it.
struct fw_color_box
{
    uint8_t y_min, y_max;
    uint8_t u_min, u_max;
    uint8_t v_min, v_max;
};

// The box laid out for 16 bytes at a time: a byte b is inside where (uint8_t)(b - low) <= span.
struct fw_threshold
{
    // As YUYV, and as U U V V: the colours alone of twice as many pixels.
    uint8_t low[16], span[16];
    uint8_t chroma_low[16], chroma_span[16];
};

// A quick look at a row for up to eight boxes at once: bit i of an entry says whether box i takes
// any of the 16 values of U, or of V, that begin with the entry's number.
struct fw_looks
{
    uint8_t u[16], v[16];
};

// The green of the TurboPi experiments; threshold.c says where the numbers come from.
struct fw_color_box fw_color_box_green(void);

// @param box each min <= max.
struct fw_threshold fw_threshold_make(const struct fw_color_box *box);

// A quick look for one box. @param width_px as below. @return false only if no pixel is inside it.
bool fw_threshold_look(const struct fw_threshold *threshold, const uint8_t *yuyv, int width_px);

// @param width_px as below. @return bit i is 0 only if no pixel of the row is inside box i.
uint8_t fw_looks_row(const struct fw_looks *looks, const uint8_t *yuyv, int width_px);

// Tests the pixels of one row.
// @param width_px even, at most FW_MAX_WIDTH_PX; 2 * width_px bytes are read.
// @param mask pixel x is bit x % 32 of word x / 32; bits past the width are 0. All words that hold
//        the width are written.
// @return true if any pixel is inside the box.
bool fw_threshold_row(const struct fw_threshold *threshold, const uint8_t *yuyv, int width_px,
                      uint32_t *mask);

#ifdef __cplusplus
}
#endif

#endif

// SPDX-License-Identifier: Apache-2.0
// A row is looked at in blocks of 32 pixels. The first pass over a block is loops over 64 bytes
// that compilers turn into vector instructions, and ends in one question: any green? Only a block
// that has some pays for the second pass, which packs its pixels into a word.
//
//   bytes    Y0  U Y1  V   Y0  U Y1  V      inside each byte's own limits? 0xFF or 0
//   pairs  [ Y0  U   Y1  V ]                pixel 0 = Y0 & U & V, pixel 1 = Y1 & U & V
#include "fw/threshold.h"

#include <string.h>

#define BLOCK_BYTES (2 * FW_MASK_WORD_PX)
#define BLOCK_PAIRS (FW_MASK_WORD_PX / 2)

// The authors' box in 8-bit CIELAB of OpenCV (L 0..252, a 48..109, b 94..207) is loose: 30 % of
// the RGB cube, cyan and blue-green too. Over a grid of the cube converted to BT.601, its upper
// limit of a is close to V <= 108. U <= 124 and Y >= 40 leave out blue-greens and what is too dark
// to have a colour: of the RGB colours in the box below 93 % are in theirs. Grey is U = V = 128 and
// stays 20 counts of V away. Saturated greens lie well inside: sRGB (0, 128, 0) is YUV (81, 91, 81)
// and (60, 180, 75) is (129, 100, 83). Pure (0, 255, 0), outside their box, is inside this one.
struct fw_color_box fw_color_box_green(void)
{
    return (struct fw_color_box){
        .y_min = 40, .y_max = 235, .u_min = 0, .u_max = 124, .v_min = 0, .v_max = 108};
}

struct fw_threshold fw_threshold_make(const struct fw_color_box *box)
{
    const uint8_t low[4] = {box->y_min, box->u_min, box->y_min, box->v_min};
    const uint8_t high[4] = {box->y_max, box->u_max, box->y_max, box->v_max};
    struct fw_threshold threshold;
    for (int i = 0; i < 16; ++i) {
        threshold.low[i] = low[i % 4];
        threshold.span[i] = (uint8_t)(high[i % 4] - low[i % 4]);
    }
    return threshold;
}

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "a pair has Y0 in its lowest byte");

// One pair of the first pass's result. @return lowest byte not zero if U and V are inside.
static uint32_t load_pair(const uint8_t *inside, int pair_idx, uint32_t *pair)
{
    memcpy(pair, inside + 4 * pair_idx, sizeof *pair);
    return (*pair >> 8) & (*pair >> 24);
}

// First pass: one byte per byte. @return not zero if the block has a pixel inside the box.
static uint32_t test_block(const struct fw_threshold *restrict threshold,
                           const uint8_t *restrict yuyv, uint8_t *restrict inside)
{
    for (int i = 0; i < BLOCK_BYTES; i += 16) {
        for (int j = 0; j < 16; ++j) {
            const uint8_t above_low = (uint8_t)(yuyv[i + j] - threshold->low[j]);
            inside[i + j] = above_low <= threshold->span[j] ? 0xFF : 0;
        }
    }
    uint32_t any = 0;
    for (int i = 0; i < BLOCK_PAIRS; ++i) {
        uint32_t pair;
        const uint32_t chroma = load_pair(inside, i, &pair);
        any |= chroma & (pair | pair >> 16);
    }
    return any & 0xFF;
}

// Second pass: one bit per pixel.
static uint32_t pack_block(const uint8_t *inside)
{
    uint32_t word = 0;
    for (int i = 0; i < BLOCK_PAIRS; ++i) {
        uint32_t pair;
        const uint32_t chroma = load_pair(inside, i, &pair) & 1;
        word |= (chroma & pair) << (2 * i) | (chroma & (pair >> 16)) << (2 * i + 1);
    }
    return word;
}

static uint32_t threshold_block(const struct fw_threshold *threshold, const uint8_t *yuyv)
{
    uint8_t inside[BLOCK_BYTES];
    return test_block(threshold, yuyv, inside) ? pack_block(inside) : 0;
}

bool fw_threshold_row(const struct fw_threshold *threshold, const uint8_t *yuyv, int width_px,
                      uint32_t *mask)
{
    const int whole_words = width_px / FW_MASK_WORD_PX;
    const int rest_px = width_px % FW_MASK_WORD_PX;
    uint32_t any = 0;
    for (int i = 0; i < whole_words; ++i) {
        mask[i] = threshold_block(threshold, yuyv + (size_t)i * BLOCK_BYTES);
        any |= mask[i];
    }
    // A last block that the row does not fill is tested in a copy; bits past the row are cleared.
    if (rest_px > 0) {
        uint8_t padded[BLOCK_BYTES] = {0};
        memcpy(padded, yuyv + (size_t)whole_words * BLOCK_BYTES, 2 * (size_t)rest_px);
        mask[whole_words] = threshold_block(threshold, padded) & ((UINT32_C(1) << rest_px) - 1);
        any |= mask[whole_words];
    }
    return any != 0;
}

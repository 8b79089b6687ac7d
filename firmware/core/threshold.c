// SPDX-License-Identifier: Apache-2.0
// A quick look asks whether any pair of pixels has the right U and V, and most rows end there. A
// row that may hold the target is cut into blocks of 32 pixels; those that the same look does not
// rule out are tested exactly and packed into one word of bits.
//
//   bytes    Y0  U Y1  V   Y0  U Y1  V      inside each byte's own limits? 0xFF or 0
//   pairs  [ Y0  U   Y1  V ]                pixel 0 = Y0 & U & V, pixel 1 = Y1 & U & V
//
// The quick look lays the colours of two vectors into one, and tests twice as many pixels at once:
//
//   a  Y0 Ua Y1 Va     b  Y0 Ub Y1 Vb       a >> 8 | b & 0xFF00 in 16 bits  ->  Ua Ub Va Vb
//
// For several boxes, a look of its own comes first: sixteen bytes at a time choose, by their upper
// four bits, entries of a table, whose bits say which boxes take such a U or V.
//
// The vectors are the compiler's own (gcc and clang, x86 and ARM alike), but for that choice.
#include "fw/threshold.h"

#include <string.h>
#if defined(__SSSE3__)
#include <tmmintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

#define BLOCK_BYTES (2 * FW_MASK_WORD_PX)

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
    for (int i = 0; i < 16; ++i)
    {
        const int chroma = i % 4 < 2 ? 1 : 3;
        threshold.low[i] = low[i % 4];
        threshold.span[i] = (uint8_t)(high[i % 4] - low[i % 4]);
        threshold.chroma_low[i] = low[chroma];
        threshold.chroma_span[i] = (uint8_t)(high[chroma] - low[chroma]);
    }
    return threshold;
}

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "a pair has Y0 in its lowest byte");

#define VECTOR_BYTES 16
typedef uint8_t byte_vector __attribute__((vector_size(VECTOR_BYTES)));
typedef uint16_t half_vector __attribute__((vector_size(VECTOR_BYTES)));
typedef uint32_t pair_vector __attribute__((vector_size(VECTOR_BYTES)));

static inline byte_vector load(const uint8_t *bytes)
{
    byte_vector vector;
    memcpy(&vector, bytes, VECTOR_BYTES);
    return vector;
}

// 0xFF for every byte inside its limits, else 0.
static inline pair_vector test_bytes(byte_vector bytes, byte_vector low, byte_vector span)
{
    return (pair_vector)(bytes - low <= span);
}

static bool may_match(const struct fw_threshold *threshold, const uint8_t *yuyv, int length_bytes)
{
    const byte_vector low = load(threshold->chroma_low), span = load(threshold->chroma_span);
    pair_vector any = {0};
    int i = 0;
    for (; i + 2 * VECTOR_BYTES <= length_bytes; i += 2 * VECTOR_BYTES)
    {
        const half_vector a = (half_vector)load(yuyv + i);
        const half_vector b = (half_vector)load(yuyv + i + VECTOR_BYTES);
        const pair_vector inside = test_bytes((byte_vector)(a >> 8 | (b & 0xFF00)), low, span);
        any |= inside & inside >> 16;
    }
    // Bytes that do not fill two vectors are left to the test.
    any &= 0xFFFF;
    uint64_t halves[2];
    memcpy(halves, &any, sizeof halves);
    return i < length_bytes || (halves[0] | halves[1]) != 0;
}

bool fw_threshold_look(const struct fw_threshold *threshold, const uint8_t *yuyv, int width_px)
{
    return may_match(threshold, yuyv, 2 * width_px);
}

// Entries of a table; each number is below 16.
static inline byte_vector choose(byte_vector table, byte_vector numbers)
{
#if defined(__SSSE3__)
    return (byte_vector)_mm_shuffle_epi8((__m128i)table, (__m128i)numbers);
#elif defined(__ARM_NEON)
    return (byte_vector)vqtbl1q_u8((uint8x16_t)table, (uint8x16_t)numbers);
#else
    byte_vector chosen;
    for (int i = 0; i < VECTOR_BYTES; ++i)
    {
        chosen[i] = table[numbers[i]];
    }
    return chosen;
#endif
}

uint8_t fw_looks_row(const struct fw_looks *looks, const uint8_t *yuyv, int width_px)
{
    const byte_vector u = load(looks->u), v = load(looks->v);
    const int length_bytes = 2 * width_px;
    pair_vector any = {0};
    int i = 0;
    for (; i + 2 * VECTOR_BYTES <= length_bytes; i += 2 * VECTOR_BYTES)
    {
        const half_vector a = (half_vector)load(yuyv + i);
        const half_vector b = (half_vector)load(yuyv + i + VECTOR_BYTES);
        const byte_vector numbers =
            (byte_vector)((pair_vector)(a >> 8 | (b & 0xFF00)) >> 4 & 0x0F0F0F0F);
        any |= (pair_vector)choose(u, numbers) & (pair_vector)choose(v, numbers) >> 16;
    }
    // Bytes that do not fill two vectors are left to the test.
    uint32_t found = i < length_bytes ? UINT8_MAX : 0;
    for (int k = 0; k < VECTOR_BYTES / 4; ++k)
    {
        found |= any[k] | any[k] >> 8;
    }
    return (uint8_t)found;
}

// The exact test of 32 pixels. @return one bit per pixel.
static uint32_t threshold_block(const struct fw_threshold *threshold, const uint8_t *yuyv)
{
    if (!may_match(threshold, yuyv, BLOCK_BYTES))
    {
        return 0;
    }
    const byte_vector low = load(threshold->low), span = load(threshold->span);
    uint32_t pairs[FW_MASK_WORD_PX / 2];
    for (int i = 0; i < BLOCK_BYTES; i += VECTOR_BYTES)
    {
        const pair_vector inside = test_bytes(load(yuyv + i), low, span);
        const pair_vector chroma = inside >> 8 & inside >> 24;
        // Pixel 0 becomes bit 0 and pixel 1 bit 1.
        const pair_vector pixels = (chroma & inside & 1) | (chroma & inside >> 16 & 1) << 1;
        memcpy(pairs + i / 4, &pixels, VECTOR_BYTES);
    }
    uint32_t word = 0;
    for (int i = 0; i < FW_MASK_WORD_PX / 2; ++i)
    {
        word |= pairs[i] << (2 * i);
    }
    return word;
}

bool fw_threshold_row(const struct fw_threshold *threshold, const uint8_t *yuyv, int width_px,
                      uint32_t *mask)
{
    const int whole_words = width_px / FW_MASK_WORD_PX;
    const int rest_px = width_px % FW_MASK_WORD_PX;
    uint32_t any = 0;
    for (int i = 0; i < whole_words; ++i)
    {
        mask[i] = threshold_block(threshold, yuyv + (size_t)i * BLOCK_BYTES);
        any |= mask[i];
    }
    // A last block that the row does not fill is tested in a copy; bits past the row are cleared.
    if (rest_px > 0)
    {
        uint8_t padded[BLOCK_BYTES] = {0};
        memcpy(padded, yuyv + (size_t)whole_words * BLOCK_BYTES, 2 * (size_t)rest_px);
        mask[whole_words] = threshold_block(threshold, padded) & ((UINT32_C(1) << rest_px) - 1);
        any |= mask[whole_words];
    }
    return any != 0;
}

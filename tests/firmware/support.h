// SPDX-License-Identifier: Apache-2.0
// What several tests of the core need: repeatable random numbers and YUYV images.
#ifndef TESTS_FIRMWARE_SUPPORT_H
#define TESTS_FIRMWARE_SUPPORT_H

#include <stdint.h>
#include <stdlib.h>

// xorshift32 (Marsaglia 2003). @param state not 0.
static inline uint32_t random_next(uint32_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 17;
    *state ^= *state << 5;
    return *state;
}

// A YUYV image whose rows are 2 * width_px bytes of pixels and then padding. The buffer is from the
// heap and ends with the last pixel, so that a sanitizer sees a read past it.
struct image
{
    uint8_t *yuyv;
    int width_px, height_px, stride_bytes;
    size_t length_bytes;
};

static inline void image_set(struct image *image, int x, int y, uint8_t luma, uint8_t u, uint8_t v)
{
    uint8_t *pair = image->yuyv + y * image->stride_bytes + 4 * (x / 2);
    pair[2 * (x % 2)] = luma;
    pair[1] = u;
    pair[3] = v;
}

// Fills x0 <= x < x1, y0 <= y < y1.
static inline void image_fill(struct image *image, int x0, int y0, int x1, int y1,
                              const uint8_t yuv[3])
{
    for (int y = y0; y < y1; ++y)
    {
        for (int x = x0; x < x1; ++x)
        {
            image_set(image, x, y, yuv[0], yuv[1], yuv[2]);
        }
    }
}

// sRGB (0, 128, 0) and mid grey in BT.601 studio range, from the standard's matrix.
static const uint8_t kGreen[3] = {81, 91, 81};
static const uint8_t kGrey[3] = {126, 128, 128};

// A grey image; whoever makes it frees yuyv.
static inline struct image image_make(int width_px, int height_px, int padding_bytes)
{
    struct image image = {
        .width_px = width_px, .height_px = height_px, .stride_bytes = 2 * width_px + padding_bytes};
    image.length_bytes = (size_t)(image.stride_bytes * height_px - padding_bytes);
    image.yuyv = malloc(image.length_bytes);
    if (image.yuyv == NULL)
    {
        abort();
    }
    // Padding is green, so that a test fails if it is read as pixels.
    for (size_t i = 0; i < image.length_bytes; ++i)
    {
        image.yuyv[i] = kGreen[i % 4 == 1 ? 1 : i % 4 == 3 ? 2 : 0];
    }
    image_fill(&image, 0, 0, width_px, height_px, kGrey);
    return image;
}

#endif

// SPDX-License-Identifier: Apache-2.0
// JPEG pictures of one sRGB colour, as a camera would send them.
#ifndef TESTS_HAL_JPEG_PICTURE_H
#define TESTS_HAL_JPEG_PICTURE_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h>

struct jpeg_picture
{
    int width_px, height_px;
    uint8_t rgb[3];
    // Sampling of luma against chroma: 2, 1 is 4:2:2, 2, 2 is 4:2:0.
    int horizontal, vertical;
    bool is_grey, is_progressive;
};

// @return its length in bytes; `file` is the caller's to free.
static inline size_t jpeg_picture_make(const struct jpeg_picture *picture, uint8_t **file)
{
    struct jpeg_compress_struct info;
    struct jpeg_error_mgr errors;
    unsigned long length = 0;
    uint8_t *row = malloc(3 * (size_t)picture->width_px);
    for (int x = 0; x < picture->width_px; ++x)
    {
        memcpy(row + 3 * x, picture->rgb, 3);
    }
    *file = NULL;
    info.err = jpeg_std_error(&errors);
    jpeg_create_compress(&info);
    jpeg_mem_dest(&info, file, &length);
    info.image_width = (unsigned)picture->width_px;
    info.image_height = (unsigned)picture->height_px;
    info.input_components = 3;
    info.in_color_space = JCS_RGB;
    jpeg_set_defaults(&info);
    jpeg_set_quality(&info, 95, TRUE);
    if (picture->is_grey)
    {
        jpeg_set_colorspace(&info, JCS_GRAYSCALE);
    }
    else
    {
        info.comp_info[0].h_samp_factor = picture->horizontal;
        info.comp_info[0].v_samp_factor = picture->vertical;
    }
    if (picture->is_progressive)
    {
        jpeg_simple_progression(&info);
    }
    jpeg_start_compress(&info, TRUE);
    while (info.next_scanline < info.image_height)
    {
        (void)jpeg_write_scanlines(&info, &row, 1);
    }
    jpeg_finish_compress(&info);
    jpeg_destroy_compress(&info);
    free(row);
    return length;
}

// Takes the segments with a marker such as 0xC4 (Huffman tables) out of a file. @return its new
// length.
static inline size_t jpeg_picture_without(uint8_t *file, size_t length, uint8_t marker)
{
    size_t at = 2;
    while (file[at + 1] != 0xDA)  // the picture itself begins
    {
        const size_t size = 2 + ((size_t)file[at + 2] << 8 | file[at + 3]);
        if (file[at + 1] == marker)
        {
            memmove(file + at, file + at + size, length - at - size);
            length -= size;
        }
        else
        {
            at += size;
        }
    }
    return length;
}

#endif

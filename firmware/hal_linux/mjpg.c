// SPDX-License-Identifier: Apache-2.0
#include "hal_linux/mjpg.h"

#include <setjmp.h>
#include <stdbool.h>
#include <stdio.h>

#include <jpeglib.h>

#include <jerror.h>

#include "fw/frame.h"

// A picture of the largest size needs less; one that asks for more is none of a camera.
#define MAX_HEAP_BYTES (8 << 20)

struct failure
{
    struct jpeg_error_mgr manager;
    jmp_buf back;
    bool is_damaged;
};

static void give_up(j_common_ptr info)
{
    longjmp(((struct failure *)(void *)info->err)->back, 1);
}

// libjpeg warns of damage and fills the rest with grey, which must not be taken for a picture.
// Bytes between two parts of a file are what many a webcam's frame has, and harm nothing.
static void note(j_common_ptr info, int level)
{
    const bool is_damage = level < 0 && info->err->msg_code != JWRN_EXTRANEOUS_DATA;
    ((struct failure *)(void *)info->err)->is_damaged |= is_damage;
}

static void say_nothing(j_common_ptr info)
{
    (void)info;
}

// Full range 0..255 to studio range: luma 16..235, chroma 16..240, rounded.
static uint8_t studio_luma(unsigned value)
{
    return (uint8_t)(16 + (value * 219 + 127) / 255);
}

static uint8_t studio_chroma(unsigned sum_of_two)
{
    return (uint8_t)(16 + (sum_of_two * 224 + 255) / 510);
}

static void pack_row(const uint8_t *ycbcr, int width_px, uint8_t *yuyv)
{
    for (int x = 0; x < width_px; x += 2, ycbcr += 6, yuyv += 4)
    {
        yuyv[0] = studio_luma(ycbcr[0]);
        yuyv[1] = studio_chroma((unsigned)ycbcr[1] + ycbcr[4]);
        yuyv[2] = studio_luma(ycbcr[3]);
        yuyv[3] = studio_chroma((unsigned)ycbcr[2] + ycbcr[5]);
    }
}

static enum fw_err decode(struct jpeg_decompress_struct *info, int width_px, int height_px,
                          uint8_t *yuyv)
{
    uint8_t row[3 * FW_MAX_WIDTH_PX];
    uint8_t *rows[] = {row};
    (void)jpeg_read_header(info, TRUE);
    if (info->image_width != (unsigned)width_px || info->image_height != (unsigned)height_px ||
        info->jpeg_color_space != JCS_YCbCr || jpeg_has_multiple_scans(info))
    {
        return FW_ERR_FORMAT;
    }
    info->out_color_space = JCS_YCbCr;
    info->dct_method = JDCT_IFAST;
    info->do_fancy_upsampling = FALSE;
    (void)jpeg_start_decompress(info);
    while (info->output_scanline < info->output_height)
    {
        (void)jpeg_read_scanlines(info, rows, 1);
        pack_row(row, width_px, yuyv);
        yuyv += 2 * width_px;
    }
    (void)jpeg_finish_decompress(info);
    return FW_OK;
}

enum fw_err mjpg_to_yuyv(const uint8_t *jpeg, size_t length_bytes, int width_px, int height_px,
                         uint8_t *yuyv)
{
    struct failure failure = {.is_damaged = false};
    struct jpeg_decompress_struct info;
    if (width_px < 2 || width_px > FW_MAX_WIDTH_PX || width_px % 2 != 0)
    {
        return FW_ERR_FORMAT;
    }
    info.err = jpeg_std_error(&failure.manager);
    failure.manager.error_exit = give_up;
    failure.manager.emit_message = note;
    failure.manager.output_message = say_nothing;
    volatile enum fw_err err = FW_ERR_IO;
    if (setjmp(failure.back) == 0)
    {
        jpeg_create_decompress(&info);
        info.mem->max_memory_to_use = MAX_HEAP_BYTES;
        jpeg_mem_src(&info, jpeg, length_bytes);
        err = decode(&info, width_px, height_px, yuyv);
    }
    jpeg_destroy_decompress(&info);
    return err == FW_OK && failure.is_damaged ? FW_ERR_IO : err;
}

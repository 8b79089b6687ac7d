// SPDX-License-Identifier: Apache-2.0
// Frames of cameras that send Motion-JPEG alone, as the YUYV that the core reads.
#ifndef HAL_LINUX_MJPG_H
#define HAL_LINUX_MJPG_H

#include <stddef.h>
#include <stdint.h>

#include "fw/err.h"

// Decodes one JPEG picture with libjpeg, which takes heap while it works. JPEG's full-range YCbCr
// (JFIF 1.02) becomes studio-range BT.601; two neighbouring pixels share the mean of their chroma.
// A file without Huffman tables, as webcams send, is read with the standard's own.
// @param yuyv 2 * width_px * height_px bytes; after an error they hold anything. @param width_px
// even.
// @return FW_OK; FW_ERR_FORMAT: of another size, grey, or in several scans; FW_ERR_IO: damaged,
// even if libjpeg could make something of it.
enum fw_err FW_MUST_CHECK mjpg_to_yuyv(const uint8_t *jpeg, size_t length_bytes, int width_px,
                                       int height_px, uint8_t *yuyv);

#endif

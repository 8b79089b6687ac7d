// SPDX-License-Identifier: Apache-2.0
// One camera image in YUYV, borrowed from whoever captured it, and the check that it can be read.
#ifndef FW_FRAME_H
#define FW_FRAME_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

// Widest frame the core can read: it sizes the scratch of one row in the context.
#define FW_MAX_WIDTH_PX 1280
#define FW_MAX_HEIGHT_PX 1024

// Two neighbouring pixels are four bytes, Y0 U Y1 V: each has its own Y, they share U and V.
struct fw_frame
{
    const uint8_t *yuyv;
    int width_px;
    int height_px;
    // From one row to the next, at least 2 * width_px.
    int stride_bytes;
    // Exposure time, by the same clock as the now_us of fw_step().
    int64_t utime_us;
    // The camera's own sequence number: a gap is a dropped frame.
    uint32_t seq;
    // Bytes that may be read at yuyv.
    size_t length_bytes;
};

// Why a frame was not used. fw_ctx counts each.
enum fw_reject
{
    FW_REJECT_NONE = 0,
    // Not of the configured width and height, or rows overlap, or there are no bytes at all.
    FW_REJECT_SIZE,
    // Fewer bytes than the last row needs.
    FW_REJECT_SHORT,
    // Exposed longer ago than the frame time-out.
    FW_REJECT_STALE,
    // Not newer than the frame before.
    FW_REJECT_REPEATED,
    // Exposed after now: the two clocks are not the same one.
    FW_REJECT_FUTURE,
    FW_REJECT_COUNT,
};

// Name of a reason for logs, in lower case. Never NULL.
const char *fw_reject_str(enum fw_reject reject);

// Checks size and length, not time. @return FW_REJECT_NONE, FW_REJECT_SIZE or FW_REJECT_SHORT.
enum fw_reject fw_frame_check(const struct fw_frame *frame, int width_px, int height_px);

#ifdef __cplusplus
}
#endif

#endif

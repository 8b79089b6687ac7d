// SPDX-License-Identifier: Apache-2.0
#include "fw/frame.h"

const char *fw_reject_str(enum fw_reject reject)
{
    switch (reject)
    {
        case FW_REJECT_NONE: return "none";
        case FW_REJECT_SIZE: return "size";
        case FW_REJECT_SHORT: return "short";
        case FW_REJECT_STALE: return "stale";
        case FW_REJECT_REPEATED: return "repeated";
        case FW_REJECT_FUTURE: return "future";
        case FW_REJECT_COUNT: break;
    }
    return "unknown";
}

enum fw_reject fw_frame_check(const struct fw_frame *frame, int width_px, int height_px)
{
    const int64_t row_bytes = 2 * (int64_t)width_px;
    if (frame->yuyv == NULL || frame->width_px != width_px || frame->height_px != height_px ||
        frame->stride_bytes < row_bytes)
    {
        return FW_REJECT_SIZE;
    }
    // The last row needs no padding after it.
    const int64_t needed_bytes = (int64_t)frame->stride_bytes * (height_px - 1) + row_bytes;
    return frame->length_bytes < (uint64_t)needed_bytes ? FW_REJECT_SHORT : FW_REJECT_NONE;
}

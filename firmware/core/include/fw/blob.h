// SPDX-License-Identifier: Apache-2.0
// Size of the largest connected blob of a mask that arrives row by row.
#ifndef FW_BLOB_H
#define FW_BLOB_H

#include <stdint.h>

#include "fw/frame.h"
#include "fw/threshold.h"

#ifdef __cplusplus
extern "C" {
#endif

// A row of width w holds at most w/2 runs, and only two rows are kept: memory cannot run out.
#define FW_MAX_RUNS_PER_ROW (FW_MAX_WIDTH_PX / 2)

// Neighbouring set pixels of one row, [begin_px, end_px).
struct fw_run
{
    uint16_t begin_px, end_px;
    // Union-find over the runs of one row: index of another run of the same blob, or of itself.
    uint16_t parent;
    // At a root: the run of the row below that took over this blob's area.
    uint16_t heir;
    // At a root: pixels of the blob so far.
    int32_t area_px;
};

// Pixels that touch by an edge or a corner are connected (8-connected, as in OpenCV's contours).
struct fw_blob
{
    struct fw_run rows[2][FW_MAX_RUNS_PER_ROW];
    // Runs in the row above, and which of the two rows that is.
    int32_t above_count;
    int32_t above;
    // Pixels of the largest blob in the rows so far.
    int32_t largest_px;
};

// Starts a new image.
void fw_blob_begin(struct fw_blob *blob);

// Adds the next row, from top to bottom.
// @param mask as fw_threshold_row() wrote it, for width_px pixels.
void fw_blob_add_row(struct fw_blob *blob, const uint32_t *mask, int width_px);

// Adds a row that has no set pixel.
void fw_blob_add_empty_row(struct fw_blob *blob);

#ifdef __cplusplus
}
#endif

#endif

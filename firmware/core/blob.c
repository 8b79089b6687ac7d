// SPDX-License-Identifier: Apache-2.0
// Runs of a row inherit the blobs of the runs above that they touch:
//
//   above   ##A##....##B##      A and B are blobs so far, with their areas
//   row     ....#####c####      c touches both: A's heir is c; B joins c's set and adds its area
//
// A blob whose last run has no heir is complete, and nothing of it needs to be kept.
#include "fw/blob.h"

#define NO_HEIR UINT16_MAX

void fw_blob_begin(struct fw_blob *blob)
{
    blob->above_count = 0;
    blob->above = 0;
    blob->largest_px = 0;
}

void fw_blob_add_empty_row(struct fw_blob *blob)
{
    blob->above_count = 0;
}

// First pixel at or after from_px that has the colour given (0 or 1); width_px if there is none.
static int find_px(const uint32_t *mask, int width_px, int from_px, int set)
{
    const uint32_t flip = set ? 0 : UINT32_MAX;
    const int words = (width_px + FW_MASK_WORD_PX - 1) / FW_MASK_WORD_PX;
    uint32_t ahead = UINT32_MAX << (from_px % FW_MASK_WORD_PX);
    for (int i = from_px / FW_MASK_WORD_PX; i < words; ++i)
    {
        const uint32_t word = (mask[i] ^ flip) & ahead;
        if (word != 0)
        {
            const int px = i * FW_MASK_WORD_PX + __builtin_ctz(word);
            return px < width_px ? px : width_px;
        }
        ahead = UINT32_MAX;
    }
    return width_px;
}

// Cuts the mask of a row into runs, each a blob of its own. @return how many.
static int32_t find_runs(const uint32_t *mask, int width_px, struct fw_run *row)
{
    int32_t count = 0;
    int begin_px = find_px(mask, width_px, 0, 1);
    while (begin_px < width_px)
    {
        const int end_px = find_px(mask, width_px, begin_px, 0);
        row[count] = (struct fw_run){.begin_px = (uint16_t)begin_px,
                                     .end_px = (uint16_t)end_px,
                                     .parent = (uint16_t)count,
                                     .heir = NO_HEIR,
                                     .area_px = end_px - begin_px};
        ++count;
        begin_px = find_px(mask, width_px, end_px, 1);
    }
    return count;
}

static uint16_t find_root(struct fw_run *row, uint16_t run)
{
    while (row[run].parent != run)
    {
        row[run].parent = row[row[run].parent].parent;
        run = row[run].parent;
    }
    return run;
}

// Makes one blob of the two.
static void unite(struct fw_run *row, uint16_t a, uint16_t b)
{
    a = find_root(row, a);
    b = find_root(row, b);
    if (a != b)
    {
        row[b].parent = a;
        row[a].area_px += row[b].area_px;
    }
}

// A run of the row touches a run above: their blobs become one.
static void connect(struct fw_run *above, uint16_t above_run, struct fw_run *row, uint16_t run)
{
    struct fw_run *blob_above = &above[find_root(above, above_run)];
    if (blob_above->heir == NO_HEIR)
    {
        blob_above->heir = run;
        row[find_root(row, run)].area_px += blob_above->area_px;
    }
    else
    {
        unite(row, blob_above->heir, run);
    }
}

void fw_blob_add_row(struct fw_blob *blob, const uint32_t *mask, int width_px)
{
    struct fw_run *above = blob->rows[blob->above];
    struct fw_run *row = blob->rows[1 - blob->above];
    const int32_t count = find_runs(mask, width_px, row);

    // Both rows are sorted: one walk finds all pairs that touch, by an edge or by a corner.
    int32_t i = 0, j = 0;
    while (i < blob->above_count && j < count)
    {
        if (above[i].begin_px <= row[j].end_px && row[j].begin_px <= above[i].end_px)
        {
            connect(above, (uint16_t)i, row, (uint16_t)j);
        }
        if (above[i].end_px < row[j].end_px)
        {
            ++i;
        }
        else
        {
            ++j;
        }
    }

    for (j = 0; j < count; ++j)
    {
        if (row[j].area_px > blob->largest_px)
        {
            blob->largest_px = row[j].area_px;
        }
    }
    blob->above = 1 - blob->above;
    blob->above_count = count;
}

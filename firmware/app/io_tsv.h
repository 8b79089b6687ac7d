// SPDX-License-Identifier: Apache-2.0
// The log of the authors' own program, so that their plots show our runs, too.
#ifndef APP_IO_TSV_H
#define APP_IO_TSV_H

#include <stdbool.h>

#include "link.h"

// A file that grows by whole rows: one that does not fit, as on a full disk, is taken back, counted
// and told.
struct io_tsv
{
    int fd;
    uint32_t lost_count;
    // The newest row was lost.
    bool is_failing;
};

// Goes on in a log that is there, or begins one. @param vote_frames of the smoothed column.
// @return false and errno on failure.
bool io_tsv_open(struct io_tsv *log, const char *path, int32_t vote_frames);

// Writes one row: Unix time in ns, the frame's bit, the vote's bit, and the move as the vendor says
// it: speed, direction in degrees (90 = forward, 270 = backward), turn positive clockwise.
void io_tsv_add(struct io_tsv *log, const struct link_report *report);

void io_tsv_close(struct io_tsv *log);

#endif

// SPDX-License-Identifier: Apache-2.0
// The log of the authors' own program, so that their plots show our runs, too.
#ifndef APP_IO_TSV_H
#define APP_IO_TSV_H

#include "link.h"
#include "whole_file.h"

// Goes on in a log that is there, or begins one. @param vote_frames of the smoothed column.
// @return false on failure, which is told once: then it is not open, and may be tried again.
bool io_tsv_open(struct whole_file *log, const char *path, int32_t vote_frames);

// Writes one row: Unix time in ns, the frame's and the vote's first bit, and the move as the vendor
// says it: speed, direction in degrees (90 = forward, 270 = backward), turn positive clockwise.
void io_tsv_add(struct whole_file *log, const struct link_report *report);

#endif

// SPDX-License-Identifier: Apache-2.0
// The log of the authors' own program, so that their plots show our runs, too.
#ifndef APP_IO_TSV_H
#define APP_IO_TSV_H

#include <stdio.h>

#include "link.h"

// Writes the header. @param vote_frames of the smoothed column.
void io_tsv_begin(FILE *file, int32_t vote_frames);

// Writes one row: Unix time in ns, the frame's bit, the vote's bit, and the move as the vendor says
// it: speed, direction in degrees (90 = forward, 270 = backward), turn positive clockwise.
void io_tsv_add(FILE *file, const struct link_report *report);

#endif

// SPDX-License-Identifier: Apache-2.0
#include "io_tsv.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#define ROW_MAX 160

bool io_tsv_open(struct whole_file *log, const char *path, int32_t vote_frames)
{
    bool ok = whole_file_open(log, "io_tsv", path, false);
    if (ok && lseek(log->fd, 0, SEEK_END) <= 0)
    {
        char row[ROW_MAX];
        const int length = snprintf(row, sizeof row,
                                    "time_ns\tdetected [0, 1]\tsmoothed_detected [0, 1] (%" PRId32
                                    ")\tmoves [(v, d, w), ...]\n",
                                    vote_frames);
        // Rows without their heading are no log.
        ok = whole_file_add(log, row, (size_t)length);
    }
    if (!ok)
    {
        whole_file_close(log);
    }
    return ok;
}

void io_tsv_add(struct whole_file *log, const struct link_report *report)
{
    char row[ROW_MAX];
    const struct fw_output *out = &report->out;
    const int32_t direction_deg = out->speed_input_pct < 0 ? 270 : 90;
    const int length =
        snprintf(row, sizeof row, "%" PRId64 "\t%d\t%d\t[(%" PRId32 ", %" PRId32 ", %g)]\n",
                 report->utime_us * 1000, out->detected_raw & 1, out->detected & 1,
                 (int32_t)labs(out->speed_input_pct), direction_deg,
                 out->turn_input_milli == 0 ? 0.0 : -out->turn_input_milli / 1000.0);
    (void)whole_file_add(log, row, (size_t)length);
}

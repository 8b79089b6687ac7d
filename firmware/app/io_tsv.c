// SPDX-License-Identifier: Apache-2.0
#include "io_tsv.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "say.h"

#define ROW_MAX 160

// The whole row or nothing of it. @return false and errno on failure.
static bool add_whole(const struct io_tsv *log, const char *row, int length)
{
    const off_t end = lseek(log->fd, 0, SEEK_END);
    const ssize_t done = write(log->fd, row, (size_t)length);
    if (done == length)
    {
        return true;
    }
    const int error = done < 0 ? errno : ENOSPC;
    if (done > 0 && end >= 0)
    {
        (void)!ftruncate(log->fd, end);
    }
    errno = error;
    return false;
}

static void add_row(struct io_tsv *log, const char *row, int length)
{
    const bool taken = add_whole(log, row, length);
    if (!taken && !log->is_failing)
    {
        say("io_tsv: %s: rows are lost from here on", strerror(errno));
    }
    if (taken && log->is_failing)
    {
        say("io_tsv: works again; %" PRIu32 " rows are lost", log->lost_count);
    }
    log->lost_count += !taken;
    log->is_failing = !taken;
}

bool io_tsv_open(struct io_tsv *log, const char *path, int32_t vote_frames)
{
    char row[ROW_MAX];
    *log = (struct io_tsv){.fd = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644)};
    if (log->fd >= 0 && lseek(log->fd, 0, SEEK_END) <= 0)
    {
        const int length = snprintf(row, sizeof row,
                                    "time_ns\tdetected [0, 1]\tsmoothed_detected [0, 1] (%" PRId32
                                    ")\tmoves [(v, d, w), ...]\n",
                                    vote_frames);
        add_row(log, row, length);
    }
    return log->fd >= 0;
}

void io_tsv_add(struct io_tsv *log, const struct link_report *report)
{
    char row[ROW_MAX];
    const struct fw_output *out = &report->out;
    const int32_t direction_deg = out->speed_input_pct < 0 ? 270 : 90;
    const int length =
        snprintf(row, sizeof row, "%" PRId64 "\t%d\t%d\t[(%" PRId32 ", %" PRId32 ", %g)]\n",
                 report->utime_us * 1000, out->detected_raw, out->detected,
                 (int32_t)labs(out->speed_input_pct), direction_deg,
                 out->turn_input_milli == 0 ? 0.0 : -out->turn_input_milli / 1000.0);
    add_row(log, row, length);
}

void io_tsv_close(struct io_tsv *log)
{
    if (log->fd >= 0)
    {
        (void)close(log->fd);
        log->fd = -1;
    }
}

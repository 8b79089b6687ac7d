// SPDX-License-Identifier: Apache-2.0
#include "io_tsv.h"

#include <inttypes.h>
#include <stdlib.h>

void io_tsv_begin(FILE *file, int32_t vote_frames)
{
    (void)fprintf(file,
                  "time_ns\tdetected [0, 1]\tsmoothed_detected [0, 1] (%" PRId32
                  ")\tmoves [(v, d, w), ...]\n",
                  vote_frames);
}

void io_tsv_add(FILE *file, const struct link_report *report)
{
    const struct fw_output *out = &report->out;
    const int32_t direction_deg = out->speed_input_pct < 0 ? 270 : 90;
    (void)fprintf(file, "%" PRId64 "\t%d\t%d\t[(%" PRId32 ", %" PRId32 ", %g)]\n",
                  report->utime_us * 1000, out->detected_raw, out->detected,
                  (int32_t)labs(out->speed_input_pct), direction_deg,
                  out->turn_input_milli == 0 ? 0.0 : -out->turn_input_milli / 1000.0);
}

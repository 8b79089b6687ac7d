// SPDX-License-Identifier: Apache-2.0
// A thread between the loop and everything slow: network and log files. The loop's side never
// waits; what the thread cannot take in time is lost and counted.
#ifndef APP_REPORTER_H
#define APP_REPORTER_H

#include <pthread.h>

#include "config.h"
#include "io_tsv.h"
#include "link.h"
#include "radio.h"
#include "telemetry.h"

struct reporter
{
    pthread_t thread;
    // Two ends of one connection that keeps messages whole.
    int loop_fd, thread_fd;
    struct telemetry telemetry;
    struct radio radio;
    // Another robot of this number was heard, and said.
    bool is_double;
    const struct app_config *config;
    // Its descriptor is -1 while it is not open; when it is tried again (monotonic).
    struct whole_file io_tsv;
    int64_t io_tsv_us;
};

// Starts the thread, and the radio's. @param config lives as long as the reporter.
// @param key of this robot; may be absent. @param link the loop's side.
// @return FW_OK; FW_ERR_IO: see errno; then nothing runs.
enum fw_err FW_MUST_CHECK reporter_start(struct reporter *reporter, const struct app_config *config,
                                         const struct seal_key *key, struct link *link);

// Ends the thread after it has passed on all that it got. @return false if rows of a log were lost.
bool reporter_stop(struct reporter *reporter);

#endif

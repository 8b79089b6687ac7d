// SPDX-License-Identifier: Apache-2.0
// A log that LCM's tools read, where lcm_url is a file. liblcm's own writer says nothing of a full
// disk, and keeps the newest messages in memory, so that a program that is killed loses them.
#ifndef APP_LCM_LOG_H
#define APP_LCM_LOG_H

#include "whole_file.h"

struct lcm_log
{
    struct whole_file file;
    int64_t event_count;
};

// Tells whether an LCM address is a file's.
bool lcm_log_is_meant(const char *url);

// @param url file://PATH?mode=w begins a log, mode=a goes on in one.
// @return false if it is another address. A file that cannot be opened is told, and tried again.
bool lcm_log_open(struct lcm_log *log, const char *url);

// Whoever opens it next goes on in it.
void lcm_log_keep(char *url);

// Tells whether two addresses are those of one log, whatever is to become of it.
bool lcm_log_is_same(const char *url, const char *other);

// Of one message.
#define LCM_LOG_MAX_BYTES 8192
// Writes one event. @param utime_us when its message was made.
void lcm_log_add(struct lcm_log *log, int64_t utime_us, const char *channel, const uint8_t *bytes,
                 uint32_t length);

#endif

// SPDX-License-Identifier: Apache-2.0
#include "lcm_log.h"

#include <endian.h>
#include <stdio.h>
#include <string.h>

#define SCHEME "file://"
#define MODE "?mode="
#define CHANNEL_MAX 64

// Big-endian, as in LCM's lcm/eventlog.c.
struct event
{
    uint32_t sync;
    uint64_t number, utime_us;
    uint32_t channel_length, data_length;
} __attribute__((packed));
#define SYNC 0xEDA1DA01u

bool lcm_log_is_meant(const char *url)
{
    return strncmp(url, SCHEME, strlen(SCHEME)) == 0;
}

// @return where w or a stands, or NULL.
static const char *find_mode(const char *url)
{
    const char *mode = strstr(url, MODE);
    mode = mode == NULL ? NULL : mode + strlen(MODE);
    return mode != NULL && (mode[0] == 'w' || mode[0] == 'a') && mode[1] == '\0' ? mode : NULL;
}

bool lcm_log_open(struct lcm_log *log, const char *url)
{
    const char *mode = find_mode(url);
    if (mode == NULL)
    {
        return false;
    }
    char path[512];
    const char *begin = url + strlen(SCHEME);
    (void)snprintf(path, sizeof path, "%.*s", (int)(mode - strlen(MODE) - begin), begin);
    log->event_count = 0;
    (void)whole_file_open(&log->file, "lcm_url", path, *mode == 'w');
    return true;
}

void lcm_log_keep(char *url)
{
    const char *mode = lcm_log_is_meant(url) ? find_mode(url) : NULL;
    if (mode != NULL)
    {
        url[mode - url] = 'a';
    }
}

bool lcm_log_is_same(const char *url, const char *other)
{
    const char *mode = lcm_log_is_meant(url) ? find_mode(url) : NULL;
    return mode != NULL && strlen(url) == strlen(other) &&
           strncmp(url, other, (size_t)(mode - url)) == 0;
}

void lcm_log_add(struct lcm_log *log, int64_t utime_us, const char *channel, const uint8_t *bytes,
                 uint32_t length)
{
    uint8_t event[sizeof(struct event) + CHANNEL_MAX + LCM_LOG_MAX_BYTES];
    const uint32_t channel_length = (uint32_t)strnlen(channel, CHANNEL_MAX);
    const struct event head = {
        .sync = htobe32(SYNC),
        .number = htobe64((uint64_t)log->event_count++),
        .utime_us = htobe64((uint64_t)utime_us),
        .channel_length = htobe32(channel_length),
        .data_length = htobe32(length),
    };
    memcpy(event, &head, sizeof head);
    memcpy(event + sizeof head, channel, channel_length);
    memcpy(event + sizeof head + channel_length, bytes, length);
    (void)whole_file_add(&log->file, event, sizeof head + channel_length + length);
}

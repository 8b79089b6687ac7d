// SPDX-License-Identifier: Apache-2.0
// Strict majority over recent frames: turns bits of single frames into the one that counts.
#ifndef FW_VOTE_H
#define FW_VOTE_H

#include <stdbool.h>
#include <stdint.h>

#include "fw/err.h"

#ifdef __cplusplus
extern "C" {
#endif

#define FW_VOTE_MAX_FRAMES 64

// A frame counts while it is among the newest max_frames and exposed less than window_us before the
// newest. Over frames alone: window_us = INT64_MAX. Over time: max_frames = FW_VOTE_MAX_FRAMES.
struct fw_vote_config
{
    // [1, FW_VOTE_MAX_FRAMES]
    int32_t max_frames;
    // > 0
    int64_t window_us;
};

struct fw_vote
{
    int64_t utime_us[FW_VOTE_MAX_FRAMES];
    uint8_t bit[FW_VOTE_MAX_FRAMES];
    // Ring: index of the oldest, how many there are, how many of them are 1.
    int32_t oldest;
    int32_t count;
    int32_t ones;
};

// The authors' vote: 10 frames, so 6 of 10 when full, and fewer frames while it fills.
struct fw_vote_config fw_vote_config_default(void);
// From milliseconds, as texts say it; 0: frames of any age count.
int64_t fw_vote_window_us(int64_t window_ms);
enum fw_err FW_MUST_CHECK fw_vote_check(const struct fw_vote_config *config);

void fw_vote_clear(struct fw_vote *vote);

// Adds one frame and forgets those that no longer count.
// @param utime_us later than the one before.
void fw_vote_push(struct fw_vote *vote, const struct fw_vote_config *config, bool bit,
                  int64_t utime_us);

// @return true if strictly more than half of the frames that count are 1; false if there is none.
bool fw_vote_result(const struct fw_vote *vote);

#ifdef __cplusplus
}
#endif

#endif

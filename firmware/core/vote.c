// SPDX-License-Identifier: Apache-2.0
#include "fw/vote.h"

struct fw_vote_config fw_vote_config_default(void)
{
    return (struct fw_vote_config){.max_frames = 10, .window_us = INT64_MAX};
}

int64_t fw_vote_window_us(int64_t window_ms)
{
    return window_ms == 0 ? INT64_MAX : window_ms * 1000;
}

enum fw_err fw_vote_check(const struct fw_vote_config *config)
{
    if (config->max_frames < 1 || config->max_frames > FW_VOTE_MAX_FRAMES || config->window_us <= 0)
    {
        return FW_ERR_VOTE;
    }
    return FW_OK;
}

void fw_vote_clear(struct fw_vote *vote)
{
    vote->oldest = 0;
    vote->count = 0;
    vote->ones = 0;
}

static void forget_oldest(struct fw_vote *vote)
{
    vote->ones -= vote->bit[vote->oldest];
    vote->oldest = (vote->oldest + 1) % FW_VOTE_MAX_FRAMES;
    --vote->count;
}

void fw_vote_push(struct fw_vote *vote, const struct fw_vote_config *config, bool bit,
                  int64_t utime_us)
{
    if (vote->count == config->max_frames)
    {
        forget_oldest(vote);
    }
    while (vote->count > 0 && (uint64_t)utime_us - (uint64_t)vote->utime_us[vote->oldest] >=
                                  (uint64_t)config->window_us)
    {
        forget_oldest(vote);
    }
    const int newest = (vote->oldest + vote->count) % FW_VOTE_MAX_FRAMES;
    vote->utime_us[newest] = utime_us;
    vote->bit[newest] = bit;
    vote->ones += bit;
    ++vote->count;
}

bool fw_vote_result(const struct fw_vote *vote)
{
    return 2 * vote->ones > vote->count;
}

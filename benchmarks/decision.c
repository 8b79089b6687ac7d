// SPDX-License-Identifier: Apache-2.0
#include "decision.h"

#include <string.h>
#include <time.h>

#include "fw/step.h"

// Of this thread alone: what other programs take from the machine does not count.
static int64_t now_ns(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static const uint8_t *frame_at(const uint8_t *frames, int frame_count, int i)
{
    return frames + (size_t)(i % frame_count) * BENCH_FRAME_BYTES;
}

int64_t bench_decide_ns(const uint8_t *frames, int frame_count, int bit_count, int count, int *seen)
{
    static struct fw_ctx ctx;
    static const struct fw_color_box others[] = {
        {40, 235, 0, 124, 165, 255}, {30, 235, 150, 255, 0, 124}, {80, 235, 0, 90, 130, 160}};
    struct fw_config config = fw_config_default();
    config.bit_count = bit_count;
    for (int i = 1; i < bit_count; ++i)
    {
        config.bits[i] = config.bits[0];
        config.bits[i].box = others[i - 1];
    }
    if (fw_init(&ctx, &config) != FW_OK)
    {
        return -1;
    }
    *seen = 0;
    const int64_t begin_ns = now_ns();
    for (int i = 0; i < count; ++i)
    {
        const struct fw_frame frame = {
            .yuyv = frame_at(frames, frame_count, i),
            .width_px = BENCH_WIDTH_PX,
            .height_px = BENCH_HEIGHT_PX,
            .stride_bytes = 2 * BENCH_WIDTH_PX,
            .utime_us = (i + 1) * INT64_C(33333),
            .seq = (uint32_t)i,
            .length_bytes = BENCH_FRAME_BYTES,
        };
        struct fw_output out;
        fw_step(&ctx, &frame, frame.utime_us, &out);
        *seen += out.detected_raw & 1;
    }
    return now_ns() - begin_ns;
}

int64_t bench_copy_ns(const uint8_t *frames, int frame_count, int count)
{
    static uint8_t copy[BENCH_FRAME_BYTES];
    const int64_t begin_ns = now_ns();
    for (int i = 0; i < count; ++i)
    {
        memcpy(copy, frame_at(frames, frame_count, i), BENCH_FRAME_BYTES);
        // Without this the compiler may leave out copies that nobody reads.
        __asm__ volatile("" : : "r"(copy) : "memory");
    }
    return now_ns() - begin_ns;
}

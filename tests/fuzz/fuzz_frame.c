// SPDX-License-Identifier: Apache-2.0
// Frames of any size, stride, length and time, one after the other, through the robot's step.
#include "fuzz.h"
#include "fw/step.h"

#define CAP_PCT 60

static int any_int(struct bytes *in)
{
    return (int)(uint32_t)take(in, 4);
}

// Mostly a frame as configured, sometimes anything at all.
static struct fw_frame take_frame(struct bytes *in, const struct fw_config *config, int64_t now_us)
{
    const unsigned wrong = (unsigned)take(in, 1);
    struct fw_frame frame = {
        .width_px = wrong & 1 ? any_int(in) : config->width_px,
        .height_px = wrong & 2 ? any_int(in) : config->height_px,
        .utime_us = wrong & 4 ? (int64_t)take(in, 8) : now_us - (int64_t)take(in, 1),
        .seq = wrong & 8 ? (uint32_t)take(in, 4) : 0,
    };
    frame.stride_bytes = wrong & 16 ? any_int(in) : 2 * config->width_px + (int)take(in, 1) % 3;
    const size_t length = (size_t)((2 * config->width_px + 2) * config->height_px);
    frame.yuyv = take_block(in, wrong & 32 ? take(in, 2) : length, &frame.length_bytes);
    return frame;
}

static void check_output(const struct fw_ctx *ctx, const struct fw_output *out)
{
    for (int wheel = 0; wheel < FW_WHEEL_COUNT; ++wheel)
    {
        CLAIM(abs(out->wheel_duty_pct[wheel]) <= CAP_PCT);
        CLAIM(ctx->has_frame || out->wheel_duty_pct[wheel] == 0);
    }
    CLAIM(out->mode == (ctx->has_frame ? FW_MODE_TABLE : FW_MODE_FAULT));
    CLAIM(out->blob_px >= 0 && out->blob_px <= ctx->config.width_px * ctx->config.height_px);
    CLAIM((out->detected_raw & 1) ==
          (ctx->has_frame && out->blob_px > ctx->config.bits[0].min_blob_px));
    CLAIM(out->detected_raw >> ctx->config.bit_count == 0);
}

static uint64_t rejected(const struct fw_ctx *ctx)
{
    uint64_t count = 0;
    for (int reason = 0; reason < FW_REJECT_COUNT; ++reason)
    {
        count += ctx->rejected_count[reason];
    }
    return count;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct fw_ctx ctx;
    struct bytes in = {data, size};
    struct fw_config config = fw_config_default();
    config.width_px = 2 + 2 * (int)take(&in, 1) % 80;
    config.height_px = 1 + (int)take(&in, 1) % 16;
    config.bit_count = 1 + (int)take(&in, 1) % FW_MAX_BITS;
    for (int i = 0; i < config.bit_count; ++i)
    {
        const uint8_t y = (uint8_t)take(&in, 1), u = (uint8_t)take(&in, 1);
        config.bits[i] = fw_bit_default();
        config.bits[i].box = (struct fw_color_box){y / 2, y, u / 2, u, 255 - u, 255};
        config.bits[i].sector = (uint8_t)(take(&in, 1) % FW_SECTOR_COUNT);
        config.bits[i].min_blob_px = (int)take(&in, 1);
    }
    config.duty_cap_pct = CAP_PCT;
    CLAIM(fw_init(&ctx, &config) == FW_OK);
    int64_t now_us = 0;
    while (in.left > 0)
    {
        now_us += (int64_t)take(&in, 2) * 16;
        struct fw_frame frame = take_frame(&in, &config, now_us);
        const uint64_t before = rejected(&ctx);
        struct fw_output out;
        fw_step(&ctx, &frame, now_us, &out);
        check_output(&ctx, &out);
        CLAIM(rejected(&ctx) - before == !!(out.status_flags & FW_STATUS_FRAME_REJECTED));
        free((void *)(uintptr_t)frame.yuyv);
    }
    return 0;
}

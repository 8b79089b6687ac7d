// SPDX-License-Identifier: Apache-2.0
#include "fw/step.h"

#include <string.h>

#include "fw/watchdog.h"

enum fw_err fw_init(struct fw_ctx *ctx, const struct fw_config *config)
{
    const enum fw_err err = fw_config_check(config);
    if (err != FW_OK)
    {
        return err;
    }
    memset(ctx, 0, sizeof *ctx);
    ctx->config = *config;
    ctx->threshold = fw_threshold_make(&config->box);
    ctx->running = true;
    return FW_OK;
}

enum fw_err fw_set_table(struct fw_ctx *ctx, const struct fw_table *table)
{
    const enum fw_err err = fw_table_check(table);
    if (err == FW_OK)
    {
        ctx->config.table = *table;
    }
    return err;
}

void fw_set_running(struct fw_ctx *ctx, bool running)
{
    ctx->running = running;
}

void fw_forget_frames(struct fw_ctx *ctx)
{
    fw_vote_clear(&ctx->vote);
    ctx->has_frame = false;
    ctx->detected_raw = false;
    ctx->blob_px = 0;
    ctx->frame_seq = 0;
    ctx->frame_utime_us = 0;
}

// The watchdog: after a gap longer than the time-out, or when the clock stepped back, nothing that
// was seen before counts any more.
static void forget_old_frames(struct fw_ctx *ctx, int64_t now_us)
{
    if (ctx->has_frame &&
        fw_watchdog_expired(ctx->frame_utime_us, now_us, ctx->config.frame_timeout_us))
    {
        fw_forget_frames(ctx);
    }
}

static enum fw_reject check_time(const struct fw_ctx *ctx, int64_t frame_utime_us, int64_t now_us)
{
    if (frame_utime_us > now_us)
    {
        return FW_REJECT_FUTURE;
    }
    if (ctx->has_frame && frame_utime_us <= ctx->frame_utime_us)
    {
        return FW_REJECT_REPEATED;
    }
    return fw_watchdog_expired(frame_utime_us, now_us, ctx->config.frame_timeout_us)
               ? FW_REJECT_STALE
               : FW_REJECT_NONE;
}

// Size of the largest blob. The frame has passed fw_frame_check().
static int32_t detect(struct fw_ctx *ctx, const struct fw_frame *frame)
{
    fw_blob_begin(&ctx->blob);
    for (int y = 0; y < frame->height_px; ++y)
    {
        const uint8_t *row = frame->yuyv + (size_t)y * (size_t)frame->stride_bytes;
        if (fw_threshold_row(&ctx->threshold, row, frame->width_px, ctx->mask))
        {
            fw_blob_add_row(&ctx->blob, ctx->mask, frame->width_px);
        }
        else
        {
            fw_blob_add_empty_row(&ctx->blob);
        }
    }
    return ctx->blob.largest_px;
}

// The one place where a frame's bit enters the robot.
static void accept_frame(struct fw_ctx *ctx, bool detected_raw, int32_t blob_px, uint32_t frame_seq,
                         int64_t frame_utime_us)
{
    fw_vote_push(&ctx->vote, &ctx->config.vote, detected_raw, frame_utime_us);
    ctx->has_frame = true;
    ctx->detected_raw = detected_raw;
    ctx->blob_px = blob_px;
    ctx->frame_seq = frame_seq;
    ctx->frame_utime_us = frame_utime_us;
}

// What the robot knows now, with duties zero. Padding is zero too, so outputs compare with memcmp.
static void begin_output(struct fw_ctx *ctx, struct fw_output *out)
{
    memset(out, 0, sizeof *out);
    out->frame_utime_us = ctx->frame_utime_us;
    out->frame_seq = ctx->frame_seq;
    out->seq = (int32_t)(ctx->seq & INT32_MAX);
    out->blob_px = ctx->blob_px;
    out->detected_raw = ctx->detected_raw;
    out->detected = fw_vote_result(&ctx->vote);
    out->mode = FW_MODE_STOPPED;
    ++ctx->seq;
}

// Every duty that leaves the core passes here.
static void cap_output(const struct fw_ctx *ctx, struct fw_output *out)
{
    if (fw_duty_cap(out->wheel_duty_pct, ctx->config.duty_cap_pct))
    {
        out->status_flags |= FW_STATUS_SPEED_CAPPED;
    }
}

static void apply_input(const struct fw_ctx *ctx, struct fw_input input, struct fw_output *out)
{
    out->speed_input_pct = input.speed_input_pct;
    out->turn_input_milli = input.turn_input_milli;
    fw_mix(&input, out->wheel_duty_pct);
    cap_output(ctx, out);
}

// From the frames that count to duties, the same for pixels and for a bare bit.
static void decide(struct fw_ctx *ctx, enum fw_reject reject, struct fw_output *out)
{
    begin_output(ctx, out);
    if (reject != FW_REJECT_NONE)
    {
        ++ctx->rejected_count[reject];
        out->status_flags |= FW_STATUS_FRAME_REJECTED;
    }
    if (!ctx->has_frame)
    {
        out->status_flags |= FW_STATUS_FRAME_STALE;
    }
    if (!ctx->running)
    {
        return;
    }
    if (!ctx->has_frame)
    {
        out->mode = FW_MODE_FAULT;
        return;
    }
    out->mode = FW_MODE_TABLE;
    apply_input(ctx, fw_table_lookup(&ctx->config.table, out->detected), out);
}

void fw_step(struct fw_ctx *ctx, const struct fw_frame *frame, int64_t now_us,
             struct fw_output *out)
{
    forget_old_frames(ctx, now_us);
    enum fw_reject reject = FW_REJECT_NONE;
    if (frame != NULL)
    {
        reject = fw_frame_check(frame, ctx->config.width_px, ctx->config.height_px);
        if (reject == FW_REJECT_NONE)
        {
            reject = check_time(ctx, frame->utime_us, now_us);
        }
        if (reject == FW_REJECT_NONE)
        {
            const int32_t blob_px = detect(ctx, frame);
            accept_frame(ctx, blob_px > ctx->config.min_blob_px, blob_px, frame->seq,
                         frame->utime_us);
        }
    }
    decide(ctx, reject, out);
}

void fw_step_bit(struct fw_ctx *ctx, bool detected_raw, int64_t frame_utime_us, uint32_t frame_seq,
                 int64_t now_us, struct fw_output *out)
{
    forget_old_frames(ctx, now_us);
    const enum fw_reject reject = check_time(ctx, frame_utime_us, now_us);
    if (reject == FW_REJECT_NONE)
    {
        accept_frame(ctx, detected_raw, 0, frame_seq, frame_utime_us);
    }
    decide(ctx, reject, out);
}

void fw_step_script_input(struct fw_ctx *ctx, const struct fw_input *input, struct fw_output *out)
{
    begin_output(ctx, out);
    if (ctx->running)
    {
        out->mode = FW_MODE_SCRIPT;
        apply_input(ctx, *input, out);
    }
}

void fw_step_script_duty(struct fw_ctx *ctx, const int8_t wheel_duty_pct[FW_WHEEL_COUNT],
                         struct fw_output *out)
{
    begin_output(ctx, out);
    if (ctx->running)
    {
        out->mode = FW_MODE_SCRIPT;
        memcpy(out->wheel_duty_pct, wheel_duty_pct, sizeof out->wheel_duty_pct);
        cap_output(ctx, out);
    }
}

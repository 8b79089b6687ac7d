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
    for (int i = 0; i < config->bit_count; ++i)
    {
        ctx->thresholds[i] = fw_threshold_make(&config->bits[i].box);
        fw_bit_look_for(&config->bits[i], i, &ctx->looks);
    }
    ctx->running = true;
    return FW_OK;
}

enum fw_err fw_set_table(struct fw_ctx *ctx, const struct fw_table *table)
{
    const enum fw_err err = fw_table_check(table);
    if (err != FW_OK)
    {
        return err;
    }
    if (table->bit_count > ctx->config.bit_count)
    {
        return FW_ERR_BITS;
    }
    ctx->config.table = *table;
    return FW_OK;
}

void fw_set_running(struct fw_ctx *ctx, bool running)
{
    ctx->running = running;
}

void fw_forget_frames(struct fw_ctx *ctx)
{
    for (int i = 0; i < FW_MAX_BITS; ++i)
    {
        fw_vote_clear(&ctx->votes[i]);
    }
    ctx->has_frame = false;
    ctx->bits_raw = 0;
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

static const uint8_t *row_of(const struct fw_frame *frame, int y)
{
    return frame->yuyv + (size_t)y * (size_t)frame->stride_bytes;
}

// Quickly: may this row of a bit's sector hold its colour?
static bool look(const struct fw_ctx *ctx, int bit, int y, const uint8_t *yuyv, int width_px)
{
    // One box alone is looked for by its own limits.
    return ctx->config.bit_count == 1 ? fw_threshold_look(&ctx->thresholds[bit], yuyv, width_px)
                                      : (ctx->row_looks[y] >> bit & 1) != 0;
}

// Size of the largest blob of a bit's colour in its sector.
static int32_t largest_px(struct fw_ctx *ctx, const struct fw_frame *frame, int bit)
{
    int begin_px, end_px;
    fw_bit_columns(&ctx->config.bits[bit], frame->width_px, &begin_px, &end_px);
    const int width_px = end_px - begin_px;
    fw_blob_begin(&ctx->blob);
    for (int y = 0; y < frame->height_px; ++y)
    {
        const uint8_t *yuyv = row_of(frame, y) + 2 * (size_t)begin_px;
        if (look(ctx, bit, y, yuyv, width_px) &&
            fw_threshold_row(&ctx->thresholds[bit], yuyv, width_px, ctx->mask))
        {
            fw_blob_add_row(&ctx->blob, ctx->mask, width_px);
        }
        else
        {
            fw_blob_add_empty_row(&ctx->blob);
        }
    }
    return ctx->blob.largest_px;
}

// Which bits the frame, which has passed fw_frame_check(), sets by itself.
// @param blob_px written for the first bit.
static uint32_t detect(struct fw_ctx *ctx, const struct fw_frame *frame, int32_t *blob_px)
{
    const struct fw_config *config = &ctx->config;
    uint32_t bits = 0;
    for (int y = 0; config->bit_count > 1 && y < frame->height_px; ++y)
    {
        ctx->row_looks[y] = fw_looks_row(&ctx->looks, row_of(frame, y), frame->width_px);
    }
    for (int bit = config->bit_count - 1; bit >= 0; --bit)
    {
        *blob_px = largest_px(ctx, frame, bit);
        bits |= (uint32_t)(*blob_px > config->bits[bit].min_blob_px) << bit;
    }
    return bits;
}

// The one place where a frame's bits enter the robot.
static void accept_frame(struct fw_ctx *ctx, uint32_t bits_raw, int32_t blob_px, uint32_t frame_seq,
                         int64_t frame_utime_us)
{
    ctx->bits_raw = 0;
    for (int i = 0; i < ctx->config.bit_count; ++i)
    {
        const bool bit = bits_raw >> i & 1;
        fw_vote_push(&ctx->votes[i], &ctx->config.bits[i].vote, bit, frame_utime_us);
        ctx->bits_raw |= (uint8_t)(bit << i);
    }
    ctx->has_frame = true;
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
    out->detected_raw = (int8_t)ctx->bits_raw;
    for (int i = 0; i < ctx->config.bit_count; ++i)
    {
        out->detected |= (int8_t)(fw_vote_result(&ctx->votes[i]) << i);
    }
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

// From the frames that count to duties, the same for pixels and for bare bits.
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
    apply_input(ctx, fw_table_lookup(&ctx->config.table, (uint32_t)out->detected), out);
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
            int32_t blob_px = 0;
            const uint32_t bits_raw = detect(ctx, frame, &blob_px);
            accept_frame(ctx, bits_raw, blob_px, frame->seq, frame->utime_us);
        }
    }
    decide(ctx, reject, out);
}

void fw_step_bits(struct fw_ctx *ctx, uint32_t bits_raw, int64_t frame_utime_us, uint32_t frame_seq,
                  int64_t now_us, struct fw_output *out)
{
    forget_old_frames(ctx, now_us);
    const enum fw_reject reject = check_time(ctx, frame_utime_us, now_us);
    if (reject == FW_REJECT_NONE)
    {
        accept_frame(ctx, bits_raw, 0, frame_seq, frame_utime_us);
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

// SPDX-License-Identifier: Apache-2.0
// The robot in one function: a frame and the time in, four duties and how they came about out.
#ifndef FW_STEP_H
#define FW_STEP_H

#include <stdbool.h>
#include <stdint.h>

#include "fw/bit.h"
#include "fw/blob.h"
#include "fw/config.h"
#include "fw/err.h"
#include "fw/frame.h"
#include "fw/mixing.h"
#include "fw/table.h"

#ifdef __cplusplus
extern "C" {
#endif

// As in telemetry_t.
enum fw_mode
{
    FW_MODE_STOPPED = 0,
    FW_MODE_TABLE = 1,
    FW_MODE_SCRIPT = 2,
    FW_MODE_FAULT = 3,
};

// Bits of status_flags that the core sets, as in telemetry_t; the application adds its own.
enum fw_status
{
    FW_STATUS_FRAME_STALE = 1,
    FW_STATUS_FRAME_REJECTED = 2,
    FW_STATUS_SPEED_CAPPED = 4,
};

// All state of one robot, about 20 KB; any number of them may live in one process. Read freely,
// change through the functions below.
struct fw_ctx
{
    struct fw_config config;
    struct fw_threshold thresholds[FW_MAX_BITS];
    // Of several bits: which of their colours each row may hold.
    struct fw_looks looks;
    uint8_t row_looks[FW_MAX_HEIGHT_PX];
    uint32_t mask[FW_MASK_WORDS];
    struct fw_blob blob;
    struct fw_vote votes[FW_MAX_BITS];
    // Frames not used, by reason.
    uint32_t rejected_count[FW_REJECT_COUNT];
    // What the last good frame said; all zero while has_frame is false.
    bool has_frame;
    uint8_t bits_raw;
    int32_t blob_px;
    uint32_t frame_seq;
    int64_t frame_utime_us;
    bool running;
    // Steps so far.
    uint32_t seq;
};

// Everything telemetry_t says of the decision.
struct fw_output
{
    // Of the frame that decided; 0 if there was none.
    int64_t frame_utime_us;
    uint32_t frame_seq;
    // Counts steps from 0.
    int32_t seq;
    // Of the first bit: pixels of the largest blob in its sector.
    int32_t blob_px;
    int32_t speed_input_pct;
    int32_t turn_input_milli;
    // Bits of fw_status.
    int32_t status_flags;
    int8_t wheel_duty_pct[FW_WHEEL_COUNT];
    // Bits as a number, of the newest frame and of the votes: bit 1 is worth 1, bit 2 worth 2.
    int8_t detected_raw;
    int8_t detected;
    // One of fw_mode.
    int8_t mode;
};

// Makes a robot that runs its table from the first good frame on.
// @return FW_OK, or the code of the first entry out of range; then ctx is untouched.
enum fw_err FW_MUST_CHECK fw_init(struct fw_ctx *ctx, const struct fw_config *config);

// Selects a table. @return FW_OK, or as fw_table_check(), or FW_ERR_BITS if the table needs more
// bits than are configured; then the old table stays.
enum fw_err FW_MUST_CHECK fw_set_table(struct fw_ctx *ctx, const struct fw_table *table);

// false: duties are zero and the mode is stopped, while frames are still looked at; true: resumes.
void fw_set_running(struct fw_ctx *ctx, bool running);

// Nothing that was seen so far counts any more, as after a camera was lost.
void fw_forget_frames(struct fw_ctx *ctx);

// One control step. Detects, votes, looks up, mixes, caps; zero duties without a fresh frame.
// @param frame the newest frame, or NULL if none came since the last step; not kept.
// @param now_us by the clock of the frames. If it steps back, old frames are forgotten.
// @param out always written.
void fw_step(struct fw_ctx *ctx, const struct fw_frame *frame, int64_t now_us,
             struct fw_output *out);

// The same step from the bits of a sensor that has no pixels; blob_px is then 0. If the sensor has
// nothing new since the last step, call fw_step() with NULL.
// @param bits_raw as a number; those beyond the configured ones do not matter.
void fw_step_bits(struct fw_ctx *ctx, uint32_t bits_raw, int64_t frame_utime_us, uint32_t frame_seq,
                  int64_t now_us, struct fw_output *out);

// Open loop: applies the inputs or duties given instead of the table's, through the same mixing and
// cap, with no look at frames, votes or the watchdog. A robot that is not running stays still.
void fw_step_script_input(struct fw_ctx *ctx, const struct fw_input *input, struct fw_output *out);
void fw_step_script_duty(struct fw_ctx *ctx, const int8_t wheel_duty_pct[FW_WHEEL_COUNT],
                         struct fw_output *out);

#ifdef __cplusplus
}
#endif

#endif

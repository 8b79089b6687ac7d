// SPDX-License-Identifier: Apache-2.0
#include "loop.h"

#include <stdio.h>
#include <string.h>

#include "loop_commands.h"
#include "loop_link.h"
#include "loop_update.h"

#define LONGEST_WAIT_US 100000
#define STOP_TRIES 10
// Of a picture, for its hash: FNV-1a.
#define HASHED_BYTES 4096
#define STOP_PAUSE_US 10000

enum fw_err loop_init(struct loop *loop, const struct app_config *config,
                      const struct own_tables *own, const struct loop_devices *devices,
                      const struct link *link)
{
    struct fw_config core;
    enum fw_err err = config_core(config, &core);
    // The script's rows stay untouched: pages that no row needs are never there.
    memset(loop, 0, offsetof(struct loop, script_rows));
    if (err == FW_OK)
    {
        err = fw_init(&loop->core, &core);
    }
    if (err != FW_OK)
    {
        return err;
    }
    loop->devices = *devices;
    loop->link = *link;
    loop->wake_fd = -1;
    loop->script_dir = config->script_dir;
    loop->own = own;
    (void)snprintf(loop->behavior, sizeof loop->behavior, "%.*s", LINK_NAME_MAX - 1,
                   config->behavior);
    loop->script.rows = loop->script_rows;
    loop->script.capacity = LOOP_SCRIPT_MAX_ROWS;
    loop->battery_low_mV = config->battery_low_mV;
    loop->watchdog_ms = config->watchdog_ms;
    loop->frozen_us = devices->camera_is_live ? (int64_t)config->frozen_ms * 1000 : 0;
    loop->may_move = true;
    loop_link_init(loop, config);
    // Not open yet: lost until the first step opens it.
    loop->lost[LOOP_CAMERA] = FW_ERR_TIMEOUT;
    return FW_OK;
}

static int64_t min_us(int64_t a, int64_t b)
{
    return a < b ? a : b;
}

// Until a frame comes; but no longer than the newest frame may decide, a start or a script's row is
// away, so that each happens in time.
static void wait_for_work(struct loop *loop)
{
    const int64_t now = loop_now_us(loop);
    int64_t timeout_us = LONGEST_WAIT_US;
    const bool plays_script = loop->running && loop->plays_script;
    if (loop->core.has_frame && !plays_script)
    {
        const int64_t frame_end_us =
            loop->core.frame_utime_us + loop->core.config.frame_timeout_us + 1;
        timeout_us = min_us(timeout_us, frame_end_us - now);
    }
    if (loop->plan.waits)
    {
        timeout_us = min_us(timeout_us, loop->plan.at_us - now);
    }
    if (plays_script)
    {
        const int64_t t_us = now - loop->script_begin_us;
        const int64_t next_us = fw_script_next_us(&loop->script, t_us);
        timeout_us = next_us == INT64_MAX ? timeout_us : min_us(timeout_us, next_us - t_us);
    }
    const int fds[] = {loop->lost[LOOP_CAMERA] == FW_OK ? hal_camera_fd(&loop->devices.camera) : -1,
                       loop->link.fd, loop->wake_fd};
    hal_clock_wait(&loop->devices.clock, fds, sizeof fds / sizeof fds[0],
                   timeout_us > 0 ? timeout_us : 0);
}

// A camera of another size than before needs a core of that size.
static enum fw_err adopt_format(struct loop *loop, const struct hal_camera_format *format)
{
    struct fw_config config = loop->core.config;
    if (config.width_px == format->width_px && config.height_px == format->height_px)
    {
        return FW_OK;
    }
    config.width_px = format->width_px;
    config.height_px = format->height_px;
    return fw_init(&loop->core, &config);
}

// It may block for seconds: not while wheels may turn.
static void close_camera(struct loop *loop)
{
    if (!loop->may_move)
    {
        hal_camera_close(&loop->devices.camera);
    }
}

static void open_camera(struct loop *loop)
{
    struct hal_camera_format format;
    close_camera(loop);
    enum fw_err err = hal_camera_open(&loop->devices.camera, &format);
    if (err == FW_OK)
    {
        err = adopt_format(loop, &format);
        if (err == FW_OK)
        {
            // Whatever the time-out, no picture of before decides.
            fw_forget_frames(&loop->core);
            loop_regain(loop, LOOP_CAMERA);
            return;
        }
        hal_camera_close(&loop->devices.camera);
    }
    loop_lose(loop, LOOP_CAMERA, err);
}

// Noise makes every picture of a real camera another: the same one for long comes from a driver
// that repeats itself, whatever its stamps say. Looks at some thousand bytes of all rows.
static bool is_frozen(struct loop *loop, const struct fw_frame *frame)
{
    const size_t stride = frame->length_bytes / HASHED_BYTES + 1;
    uint64_t hash = 14695981039346656037u;
    for (size_t i = 0; i < frame->length_bytes; i += stride)
    {
        hash = (hash ^ frame->yuyv[i]) * 1099511628211u;
    }
    if (hash != loop->picture_hash)
    {
        loop->picture_hash = hash;
        loop->picture_since_us = loop_now_us(loop);
    }
    return loop->frozen_us > 0 && loop_now_us(loop) - loop->picture_since_us > loop->frozen_us;
}

// @return true if there is a new frame.
static bool take_frame(struct loop *loop, struct fw_frame *frame)
{
    if (loop->lost[LOOP_CAMERA] != FW_OK)
    {
        if (!loop->may_move && loop_now_us(loop) >= loop->retry_us[LOOP_CAMERA])
        {
            open_camera(loop);
        }
        return false;
    }
    enum fw_err err = hal_camera_take(&loop->devices.camera, frame);
    err = err == FW_OK && is_frozen(loop, frame) ? FW_ERR_FROZEN : err;
    if (err == FW_OK || err == FW_ERR_TIMEOUT)
    {
        return err == FW_OK;
    }
    loop_lose(loop, LOOP_CAMERA, err);
    loop->camera_over = err == FW_ERR_END;
    close_camera(loop);
    return false;
}

// Whoever could stop this program if it hangs does live.
static bool is_guarded(const struct loop *loop)
{
    return loop->watch == NULL ||
           (watch_silent_ms(loop->watch, WATCH_SUPERVISOR) <= loop->watchdog_ms &&
            watch_silent_ms(loop->watch, WATCH_GUARD) <= loop->watchdog_ms);
}

// All that hold; whether the newest frame is fresh the core knows.
static uint8_t conditions(const struct loop *loop, bool is_fresh)
{
    const enum fw_err *lost = loop->lost;
    const bool holds[] = {
        [ROBOT_BOARD_CONFIRMS] = lost[LOOP_BOARD] == FW_OK,
        [ROBOT_CAMERA_WORKS] = lost[LOOP_CAMERA] == FW_OK,
        [ROBOT_FRAME_FRESH] = is_fresh,
        [ROBOT_BATTERY_OK] = !loop->battery_low,
        [ROBOT_PARTS_ANSWER] = lost[LOOP_BATTERY] == FW_OK && lost[LOOP_PANEL] == FW_OK,
        [ROBOT_GUARDED] = is_guarded(loop),
        [ROBOT_WISHED] = loop->running,
    };
    _Static_assert(sizeof holds / sizeof holds[0] == ROBOT_CONDITION_COUNT, "each is looked at");
    uint8_t set = 0;
    for (int i = 0; i < ROBOT_CONDITION_COUNT; ++i)
    {
        set = (uint8_t)(set | (holds[i] ? ROBOT_BIT(i) : 0));
    }
    return set;
}

static bool may_drive(const struct loop *loop)
{
    return robot_next(loop->state, conditions(loop, true)) == ROBOT_DRIVING;
}

static void decide_by_script(struct loop *loop, int64_t t_us, struct fw_output *out)
{
    static const struct fw_script_row idle = {0};
    const struct fw_script_row *row = fw_script_at(&loop->script, t_us);
    row = row != NULL ? row : &idle;
    if (loop->script.has_duties)
    {
        fw_step_script_duty(&loop->core, row->wheel_duty_pct, out);
    }
    else
    {
        fw_step_script_input(&loop->core, &row->input, out);
    }
}

static void decide(struct loop *loop, const struct fw_frame *frame, struct fw_output *out)
{
    const int64_t now = loop_now_us(loop);
    const int64_t t_us = now - loop->script_begin_us;
    if (loop->running && loop->plays_script && fw_script_next_us(&loop->script, t_us) == INT64_MAX)
    {
        loop_stop(loop);
        loop->script_over = true;
    }
    fw_set_running(&loop->core, may_drive(loop));
    if (loop->running && loop->plays_script)
    {
        decide_by_script(loop, t_us, out);
    }
    else
    {
        fw_step(&loop->core, frame, now, out);
    }
}

// What telemetry calls it, now that the board was told.
static void settle_state(struct loop *loop, struct fw_output *out)
{
    const bool needs_frames = !(loop->running && loop->plays_script);
    const bool is_fresh = !needs_frames || (out->status_flags & FW_STATUS_FRAME_STALE) == 0;
    loop->state = robot_next(loop->state, conditions(loop, is_fresh));
    if (loop->state != ROBOT_DRIVING)
    {
        out->mode = loop->state == ROBOT_STANDING ? FW_MODE_STOPPED : FW_MODE_FAULT;
    }
}

static void drive(struct loop *loop, struct fw_output *out)
{
    const enum fw_err err = loop_drive(loop, out->wheel_duty_pct);
    if (err == FW_OK)
    {
        loop_regain(loop, LOOP_BOARD);
        return;
    }
    loop_lose(loop, LOOP_BOARD, err);
    memcpy(out->wheel_duty_pct, loop->wheel_duty_pct, sizeof out->wheel_duty_pct);
}

static int32_t status_flags(const struct loop *loop, const struct fw_output *out)
{
    const bool drives = out->mode == FW_MODE_TABLE || out->mode == FW_MODE_SCRIPT;
    return out->status_flags | (loop->battery_low ? LINK_STATUS_BATTERY_LOW : 0) |
           (loop->lost[LOOP_BOARD] != FW_OK ? LINK_STATUS_BOARD_LOST : 0) |
           (loop->lost[LOOP_CAMERA] != FW_OK ? LINK_STATUS_CAMERA_LOST : 0) |
           (loop->may_move && !drives ? LINK_STATUS_STOP_UNCONFIRMED : 0) |
           (is_guarded(loop) ? 0 : LINK_STATUS_UNGUARDED);
}

static void report(struct loop *loop, const struct fw_output *out, int64_t begin_us)
{
    const int64_t now = loop_now_us(loop);
    const int64_t unix_offset_us = hal_clock_unix_us(&loop->devices.clock) - now;
    struct link_report report = {
        .out = *out,
        .utime_us = now + unix_offset_us,
        .frame_utime_us = out->frame_utime_us == 0 ? 0 : out->frame_utime_us + unix_offset_us,
        .loop_us = (int32_t)(now - begin_us),
        .pack_mV = loop->battery_count > 0
                       ? loop->battery_mV[(loop->battery_count - 1) % LOOP_BATTERY_READINGS]
                       : 0,
        .status_flags = status_flags(loop, out),
        .panel_lost = loop->lost[LOOP_PANEL] != FW_OK,
        .lost_report_count = loop->lost_report_count,
    };
    loop_link_report(loop, &report);
    memcpy(report.behavior, loop->behavior, sizeof report.behavior);
    memcpy(report.rejected_count, loop->core.rejected_count, sizeof report.rejected_count);
    hal_camera_stats(&loop->devices.camera, &report.camera);
    loop->lost_report_count += !loop->link.send_report(loop->link.context, &report);
}

static void beat(const struct loop *loop)
{
    if (loop->watch != NULL)
    {
        watch_beat(loop->watch, WATCH_DRIVER);
    }
}

// Before anything that may take its time, such as opening a camera.
static void stand_first(struct loop *loop)
{
    const enum fw_err err = loop->may_move && !may_drive(loop) ? loop_halt(loop) : FW_OK;
    if (err != FW_OK && loop->lost[LOOP_BOARD] == FW_OK)
    {
        loop->lost[LOOP_BOARD] = err;
    }
}

void loop_step(struct loop *loop)
{
    wait_for_work(loop);
    beat(loop);
    const int64_t begin_us = loop_now_us(loop);
    loop_obey_commands(loop);
    stand_first(loop);
    struct fw_frame frame;
    struct fw_output out;
    const bool has_frame = take_frame(loop, &frame);
    decide(loop, has_frame ? &frame : NULL, &out);
    drive(loop, &out);
    settle_state(loop, &out);
    loop_link_tell(loop);
    report(loop, &out, begin_us);
    loop_update_panel(loop, out.detected);
    loop_update_battery(loop);
}

bool loop_close(struct loop *loop)
{
    loop_stop(loop);
    for (int tries = 0; tries < STOP_TRIES && loop_halt(loop) != FW_OK; ++tries)
    {
        hal_clock_wait(&loop->devices.clock, NULL, 0, STOP_PAUSE_US);
    }
    if (!loop->may_move)
    {
        hal_camera_close(&loop->devices.camera);
        hal_panel_close(&loop->devices.panel);
        hal_motors_close(&loop->devices.motors);
    }
    return !loop->may_move;
}

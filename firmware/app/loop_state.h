// SPDX-License-Identifier: Apache-2.0
// What a robot's control loop knows, and the changes of it that more than one of its parts makes.
#ifndef APP_LOOP_STATE_H
#define APP_LOOP_STATE_H

#include "config.h"
#include "fw/script.h"
#include "fw/step.h"
#include "hal/battery.h"
#include "hal/camera.h"
#include "hal/clock.h"
#include "hal/motors.h"
#include "hal/panel.h"
#include "latch.h"
#include "link.h"
#include "own_tables.h"
#include "robot_state.h"
#include "watch.h"

#define LOOP_SCRIPT_MAX_ROWS 4096
#define LOOP_BATTERY_READINGS 5
#define LOOP_LINK_ACKS_MAX 16

#define LOOP_REASON_MAX 320

// The parts that can be lost and come back. A robot that has lost one stands still.
enum loop_part
{
    LOOP_CAMERA,
    LOOP_BOARD,
    LOOP_BATTERY,
    LOOP_PANEL,
    LOOP_PART_COUNT,
};

struct loop_devices
{
    struct hal_camera camera;
    struct hal_motors motors;
    struct hal_battery battery;
    struct hal_panel panel;
    struct hal_clock clock;
    // "i2c" or "uart", as in the configuration; NULL: neither.
    const char *board;
    // Looks at the world: a picture that never changes is none. Recordings may stand still.
    bool camera_is_live;
    // The board is a stand-in, and no motor moves.
    bool dry_run;
    // Says which device failed, why, and what to do; NULL: the error alone is told.
    void (*explain)(const struct app_config *config, enum loop_part part, enum fw_err err,
                    char reason[LOOP_REASON_MAX]);
    const struct app_config *config;
};

// A start that waits for its instant (monotonic: a clock that is set in between changes nothing),
// and what will be played then.
struct loop_plan
{
    bool waits;
    int64_t at_us;
    bool plays_script;
    // Table to be selected; empty: the one that is.
    char behavior[LINK_NAME_MAX];
};

// The link to the operator, as loop_link.h keeps it.
struct loop_link
{
    // Begin of the session, and when the operator was heard last (monotonic).
    int64_t session_begin_us, heard_us;
    // Without a word from the operator a robot that was started drives for so long; 0: for ever.
    int32_t timeout_ms, configured_timeout_ms;
    // It stands because that time was over.
    bool lost;
    // Answers of this step, which are told when the motor board has been.
    struct link_ack acks[LOOP_LINK_ACKS_MAX];
    int ack_count;
    struct latch latch;
};

struct loop
{
    struct loop_devices devices;
    struct link link;
    // Another descriptor that ends waiting, for signals; -1: none.
    int wake_fd;
    struct fw_ctx core;
    char behavior[LINK_NAME_MAX];
    const char *script_dir;
    // That commands can name.
    const struct own_tables *own;

    enum robot_state state;

    // Lost parts, with what, and when they are tried again (monotonic).
    enum fw_err lost[LOOP_PART_COUNT];
    int64_t retry_us[LOOP_PART_COUNT];

    // The operator's wish, and the start that it may wait for.
    bool running;
    struct loop_plan plan;
    struct fw_command_filter filter;
    struct loop_link operator_link;

    // Playing a script instead of the table, since when (monotonic).
    bool plays_script;
    int64_t script_begin_us;
    struct fw_script script;

    // Newest readings; the battery is low for good when all are below the limit.
    int32_t battery_low_mV;
    int32_t battery_mV[LOOP_BATTERY_READINGS];
    int32_t battery_count;
    int64_t battery_next_us;
    bool battery_low;

    // Button, as seen in the last step and as debounced.
    bool button_seen, button_down;

    // Shared with the processes that watch this one; NULL: nobody does.
    struct watch *watch;
    int32_t watchdog_ms;
    // Wheels may turn: from before the first byte that moves one until a stop is confirmed. At
    // first nobody knows.
    bool may_move;
    // What the board took last, and when a stop is to be confirmed again (monotonic).
    int8_t wheel_duty_pct[FW_WHEEL_COUNT];
    int64_t confirm_us;
    // What was seen, and since when it has been the same (monotonic); 0 us: never too long.
    uint64_t picture_hash;
    int64_t picture_since_us, frozen_us;
    // The camera's recording or the script is over.
    bool camera_over, script_over;
    uint32_t lost_report_count;

    // Storage of the script.
    struct fw_script_row script_rows[LOOP_SCRIPT_MAX_ROWS];
};

int64_t loop_now_us(const struct loop *loop);

// Drives from now on, or stops; also what the button does.
void loop_start(struct loop *loop);
void loop_stop(struct loop *loop);

// Four duties to the board, which is a stop if all are zero.
enum fw_err FW_MUST_CHECK loop_drive(struct loop *loop,
                                     const int8_t wheel_duty_pct[FW_WHEEL_COUNT]);

// Zero to all wheels. @return FW_OK once the board has confirmed that they stand.
enum fw_err FW_MUST_CHECK loop_halt(struct loop *loop);

// Stops the motors, then notes and tells the failure; the part is tried again later.
void loop_lose(struct loop *loop, enum loop_part part, enum fw_err err);
void loop_regain(struct loop *loop, enum loop_part part);

#endif

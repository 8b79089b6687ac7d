// SPDX-License-Identifier: Apache-2.0
// One robot: devices in, duties out, once per frame. What the wheels do is decided by the core; the
// loop decides only when they must stand still.
#ifndef APP_LOOP_H
#define APP_LOOP_H

#include "config.h"
#include "fw/script.h"
#include "fw/step.h"
#include "hal/battery.h"
#include "hal/camera.h"
#include "hal/clock.h"
#include "hal/motors.h"
#include "hal/panel.h"
#include "link.h"
#include "own_tables.h"

#define LOOP_SCRIPT_MAX_ROWS 4096
#define LOOP_BATTERY_READINGS 5

struct loop_devices
{
    struct hal_camera camera;
    struct hal_motors motors;
    struct hal_battery battery;
    struct hal_panel panel;
    struct hal_clock clock;
    // "i2c" or "uart", as in the configuration; NULL: neither.
    const char *board;
};

// The parts that can be lost and come back. A robot that has lost one stands still.
enum loop_part
{
    LOOP_CAMERA,
    LOOP_BOARD,
    LOOP_BATTERY,
    LOOP_PANEL,
    LOOP_PART_COUNT,
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

    // Lost parts, with what, and when they are tried again (monotonic).
    enum fw_err lost[LOOP_PART_COUNT];
    int64_t retry_us[LOOP_PART_COUNT];

    // The operator's wish, and the start it may wait for (Unix time).
    bool running;
    bool start_pending;
    int64_t start_utime_us;
    struct fw_inbox inbox;

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

    // Duties that the board was told last are not all zero.
    bool moving;
    // Called before the board is told to move from standstill, unless NULL.
    void (*before_moving)(const void *context);
    const void *before_moving_context;
    // The camera's recording or the script is over.
    bool camera_over, script_over;
    uint32_t lost_report_count;

    // Storage of the script.
    struct fw_script_row script_rows[LOOP_SCRIPT_MAX_ROWS];
};

// @param config already checked by config_core(); its script_dir is not copied, nor is own.
// @return FW_OK, or why the core refuses the configuration.
enum fw_err FW_MUST_CHECK loop_init(struct loop *loop, const struct app_config *config,
                                    const struct own_tables *own,
                                    const struct loop_devices *devices, const struct link *link);

// Waits for a frame, a command or the next thing due, then does one control step.
void loop_step(struct loop *loop);

// Stops the motors and gives all devices back.
void loop_close(struct loop *loop);

// Drives from now on, or stops; also what the button does.
void loop_start(struct loop *loop);
void loop_stop(struct loop *loop);

// Reads a script file into the loop. @param reason on failure one sentence.
bool loop_load_script(struct loop *loop, const char *path, char reason[LINK_REASON_MAX]);

// Parts of loop_step(), each in a file of its own.

// Obeys what has come since the last step, and a start that has come due.
void loop_obey_commands(struct loop *loop);
// Button, lights and battery: after the motors, as nothing waits for them.
void loop_tend_panel(struct loop *loop, bool detected);
void loop_tend_battery(struct loop *loop);
// Notes a failure and stops the motors; the part is tried again later.
void loop_lose(struct loop *loop, enum loop_part part, enum fw_err err);
void loop_regain(struct loop *loop, enum loop_part part);

#endif

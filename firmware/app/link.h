// SPDX-License-Identifier: Apache-2.0
// What the control loop and the outside say to each other. The loop never waits for it.
#ifndef APP_LINK_H
#define APP_LINK_H

#include <stdbool.h>
#include <stdint.h>

#include "fw/command.h"
#include "fw/step.h"
#include "hal/camera.h"
#include "radio/seal.h"

#define LINK_NAME_MAX 48
#define LINK_REASON_MAX 96

// Bits of status_flags that the application adds to those of fw_status, as in telemetry_t.
enum link_status
{
    LINK_STATUS_BATTERY_LOW = 8,
    LINK_STATUS_BOARD_LOST = 16,
    LINK_STATUS_CAMERA_LOST = 32,
    LINK_STATUS_STOP_UNCONFIRMED = 64,
    LINK_STATUS_UNGUARDED = 128,
    LINK_STATUS_LOG_LOST = 256,
    LINK_STATUS_LINK_LOST = 512,
    LINK_STATUS_UNTETHERED = 1024,
    LINK_STATUS_LATCHED = 2048,
    LINK_STATUS_DOUBLE = 4096,
    LINK_STATUS_LATCH_LOST = 8192,
    LINK_STATUS_DRY_RUN = 16384,
    LINK_STATUS_AWAITS_START = 32768,
    LINK_STATUS_TELLS_START = 65536,
};

// One control step: what telemetry says, and the counters that explain it.
struct link_report
{
    struct fw_output out;
    // Unix times: duties written; frame exposed, 0 if there was none.
    int64_t utime_us, frame_utime_us;
    int32_t loop_us;
    // 0 if not measured.
    int32_t pack_mV;
    int32_t status_flags;
    bool panel_lost;
    // Packets on the operator's channels that were not even answered.
    uint32_t ignored_count;
    // As in link_t.
    int64_t session_us, counter;
    int32_t link_timeout_ms;
    bool stands;
    char behavior[LINK_NAME_MAX];
    struct hal_camera_stats camera;
    uint32_t rejected_count[FW_REJECT_COUNT];
    // Reports before this one that nobody took.
    uint32_t lost_report_count;
};

struct link_command
{
    struct fw_command order;
    // Table or script.
    char name[LINK_NAME_MAX];
};

struct link_ack
{
    int64_t utime_us, session_us;
    // Of the command.
    int64_t command_utime_us;
    int32_t seq;
    int8_t verb;
    bool accepted;
    // The motor board has taken zero for all wheels since.
    bool stands;
    // Why it is not accepted, or what whoever sent it should know besides.
    char reason[LINK_REASON_MAX];
};

// How the loop reaches the other side; all calls return at once.
struct link
{
    void *context;
    // @return false if the report was lost.
    bool (*send_report)(void *context, const struct link_report *report);
    void (*send_ack)(void *context, const struct link_ack *ack);
    // @return true if there was a command.
    bool (*receive)(void *context, struct link_command *command);
    // Readable when a command has come; -1 if there is none.
    int fd;
    // Of this run of the program: a random number that signed commands must name; 0: obeys none.
    int64_t session;
    // Of this robot's key: see seal_name().
    char key_name[SEAL_NAME_MAX];
};

#endif

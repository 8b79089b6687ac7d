// SPDX-License-Identifier: Apache-2.0
// Which device stands behind each header, by the configuration.
#ifndef APP_DEVICES_H
#define APP_DEVICES_H

#include "config.h"
#include "hal_linux/motors_i2c.h"
#include "hal_linux/motors_uart.h"
#include "hal_stub/stub_board.h"
#include "loop_state.h"

// Whichever board it is, its driver's state is here.
struct board_drivers
{
    struct motors_i2c i2c;
    struct motors_uart uart;
    struct stub_board stub;
};

// Picks the drivers; no device is opened but to tell boards apart. The drivers' state is static:
// one robot per process.
// @param config lives as long as the devices. @param dry_run no real board and panel.
// @param error on failure one sentence.
bool devices_make(const struct app_config *config, bool dry_run, struct loop_devices *devices,
                  char error[CONFIG_ERROR_MAX]);

// A camera or board may come back; a recording that cannot be played never does. Other cameras
// pass.
bool devices_check_recording(const struct app_config *config, const struct loop_devices *devices,
                             char error[CONFIG_ERROR_MAX]);

// The motor board alone, for a process that only stops it. @param drivers lives as long as devices.
bool devices_make_board(const struct app_config *config, bool dry_run,
                        struct board_drivers *drivers, struct loop_devices *devices,
                        char error[CONFIG_ERROR_MAX]);

// Checks the board's kind; finds out which there is if the configuration leaves it open, and writes
// it there. @return false, with one sentence, if none answers or there is no such kind.
bool devices_settle_board(struct app_config *config, bool dry_run, char error[CONFIG_ERROR_MAX]);

// The device or file that only one program may drive; NULL: none.
const char *devices_board_path(const struct app_config *config, bool dry_run);

#endif

// SPDX-License-Identifier: Apache-2.0
// Which device stands behind each header, by the configuration.
#ifndef APP_DEVICES_H
#define APP_DEVICES_H

#include "config.h"
#include "loop_state.h"

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

// The motor board alone, for a process that only stops it.
bool devices_make_board(const struct app_config *config, bool dry_run, struct loop_devices *devices,
                        char error[CONFIG_ERROR_MAX]);

// Looks which board there is, if the configuration leaves it open, and writes it there; without an
// answer it stays open.
void devices_settle_board(struct app_config *config, bool dry_run);

#endif

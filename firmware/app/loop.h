// SPDX-License-Identifier: Apache-2.0
// One robot: devices in, duties out, once per frame. What the wheels do is decided by the core; the
// loop decides only when they must stand still.
#ifndef APP_LOOP_H
#define APP_LOOP_H

#include "loop_state.h"

// @param config already checked by config_core(); its script_dir is not copied, nor is own.
// @return FW_OK, or why the core refuses the configuration.
enum fw_err FW_MUST_CHECK loop_init(struct loop *loop, const struct app_config *config,
                                    const struct own_tables *own,
                                    const struct loop_devices *devices, const struct link *link);

// Waits for a frame, a command or the next thing due, then does one control step.
void loop_step(struct loop *loop);

// Stops the motors, then gives all devices back, which may block. @return false if no stop was
// confirmed: then the devices stay as they are.
bool loop_close(struct loop *loop);

#endif

// SPDX-License-Identifier: Apache-2.0
// Button, lights and battery: after the motors, as nothing waits for them.
#ifndef APP_LOOP_UPDATE_H
#define APP_LOOP_UPDATE_H

#include "loop_state.h"

void loop_update_panel(struct loop *loop, bool detected);
void loop_update_battery(struct loop *loop);

#endif

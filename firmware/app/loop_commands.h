// SPDX-License-Identifier: Apache-2.0
// What an operator may tell the robot, and what it answers.
#ifndef APP_LOOP_COMMANDS_H
#define APP_LOOP_COMMANDS_H

#include "loop_state.h"

// Reads a script file into the loop. @param reason on failure one sentence.
bool loop_load_script(struct loop *loop, const char *path, char reason[LINK_REASON_MAX]);

// Obeys what has come since the last step, and a start that has come due.
void loop_obey_commands(struct loop *loop);

#endif

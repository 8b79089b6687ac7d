// SPDX-License-Identifier: Apache-2.0
// One program per motor board, and who else is there.
#ifndef APP_INSTANCE_H
#define APP_INSTANCE_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

#define INSTANCE_WHO_MAX 160

// Takes a board, by its device's path, for this process and its children, until the last of them
// has ended or closed the descriptor. @return the descriptor; -1 if another program has it, whose
// pid is then in holder (0: unknown).
int instance_take(const char *path, pid_t *holder);

// @return pid of the program that has the board, 0 if there is none, -1 if it is not known.
pid_t instance_holder(const char *path);

// A process in words: its name, pid and systemd unit.
void instance_describe(pid_t pid, char who[INSTANCE_WHO_MAX]);

// Who has a device open, of the processes that this user may look into. @return false if nobody.
bool instance_user_of(const char *path, char who[INSTANCE_WHO_MAX]);

// A program of the robot's vendor or of the published TurboPi projects that runs now: it may write
// to the wheels at any time. @return false if there is none.
bool instance_vendor(char who[INSTANCE_WHO_MAX]);

#endif

// SPDX-License-Identifier: Apache-2.0
// What a service tells systemd.
#ifndef APP_NOTIFY_H
#define APP_NOTIFY_H

// Sends one state, such as "READY=1" or "WATCHDOG=1", as sd_notify(3) describes; without systemd
// nothing happens.
void notify(const char *state);

#endif

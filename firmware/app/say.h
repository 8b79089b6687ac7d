// SPDX-License-Identifier: Apache-2.0
// Lines for people, on stderr. Whoever drives or stops wheels never waits for who reads them.
#ifndef APP_SAY_H
#define APP_SAY_H

#include <stdbool.h>

// From now on stderr of this process and its children is a pipe that takes what it can and never
// blocks; a process of its own passes it on. What libraries print goes the same way.
// @return false if the system refuses.
bool say_never_wait(void);

// One line, with the program's name before it and its end behind it. Lines that nobody took are
// counted, and told before the next one that is taken.
void say(const char *format, ...) __attribute__((format(printf, 1, 2)));

#endif

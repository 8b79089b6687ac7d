// SPDX-License-Identifier: Apache-2.0
// `turbopi --stop`: needs no configuration, and says what it has done after it has done it.
#ifndef APP_STOP_COMMAND_H
#define APP_STOP_COMMAND_H

#include "options.h"

// Tells zero to the board that is known, and, unless that is sure and confirms it, to every board
// that can be found. Ends the program that drives it, if one does. @return the exit code: 0 if what
// was known of, or else anything that was found, has confirmed the stop.
int stop_command(const struct options *options);

#endif

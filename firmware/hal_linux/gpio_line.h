// SPDX-License-Identifier: Apache-2.0
// One GPIO line, whichever version of libgpiod is installed: their interfaces share no call, and
// the build compiles gpio_line_v1.c or gpio_line_v2.c by what pkg-config says.
#ifndef HAL_LINUX_GPIO_LINE_H
#define HAL_LINUX_GPIO_LINE_H

#include <stdbool.h>

#include "fw/err.h"

// Opaque: a line of the library's own kind.
struct gpio_line;

// Reserves a line of a chip such as /dev/gpiochip0. Input: pulled up. Output: starts low.
// @param line the line on success, or NULL; whoever opens it closes it.
// @return FW_OK, FW_ERR_NO_DEVICE, or FW_ERR_IO (a line that somebody else has, too).
enum fw_err FW_MUST_CHECK gpio_line_open_input(const char *chip, unsigned offset,
                                               struct gpio_line **line);
enum fw_err FW_MUST_CHECK gpio_line_open_output(const char *chip, unsigned offset,
                                                struct gpio_line **line);

// @return FW_OK, or the cause.
enum fw_err FW_MUST_CHECK gpio_line_get(struct gpio_line *line, bool *high);
enum fw_err FW_MUST_CHECK gpio_line_set(struct gpio_line *line, bool high);

// NULL is allowed.
void gpio_line_close(struct gpio_line *line);

#endif

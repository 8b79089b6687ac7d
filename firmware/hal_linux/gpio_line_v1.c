// SPDX-License-Identifier: Apache-2.0
// libgpiod 1: Debian 12, Raspberry Pi OS bookworm.
#include <errno.h>
#include <gpiod.h>

#include "gpio_line.h"
#include "hal_linux/sys.h"

#define CONSUMER "turbopi"

static struct gpiod_line *native(struct gpio_line *line)
{
    return (struct gpiod_line *)line;
}

static enum fw_err open_line(const char *path, unsigned offset, bool output,
                             struct gpio_line **line)
{
    *line = NULL;
    struct gpiod_chip *chip = gpiod_chip_open(path);
    if (chip == NULL)
    {
        return hal_sys_err(errno);
    }
    struct gpiod_line *got = gpiod_chip_get_line(chip, offset);
    if (got == NULL || (output ? gpiod_line_request_output(got, CONSUMER, 0)
                               : gpiod_line_request_input_flags(
                                     got, CONSUMER, GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP)) != 0)
    {
        const enum fw_err err = hal_sys_err(errno);
        gpiod_chip_close(chip);
        return err;
    }
    *line = (struct gpio_line *)got;
    return FW_OK;
}

enum fw_err gpio_line_open_input(const char *chip, unsigned offset, struct gpio_line **line)
{
    return open_line(chip, offset, false, line);
}

enum fw_err gpio_line_open_output(const char *chip, unsigned offset, struct gpio_line **line)
{
    return open_line(chip, offset, true, line);
}

enum fw_err gpio_line_get(struct gpio_line *line, bool *high)
{
    const int value = gpiod_line_get_value(native(line));
    if (value < 0)
    {
        return hal_sys_err(errno);
    }
    *high = value == 1;
    return FW_OK;
}

enum fw_err gpio_line_set(struct gpio_line *line, bool high)
{
    return gpiod_line_set_value(native(line), high) == 0 ? FW_OK : hal_sys_err(errno);
}

void gpio_line_close(struct gpio_line *line)
{
    if (line != NULL)
    {
        // Gives the line back, too; each line has opened the chip for itself.
        gpiod_chip_close(gpiod_line_get_chip(native(line)));
    }
}

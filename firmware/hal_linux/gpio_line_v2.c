// SPDX-License-Identifier: Apache-2.0
// libgpiod 2: Debian 13, Raspberry Pi OS trixie.
#include <errno.h>
#include <gpiod.h>

#include "gpio_line.h"
#include "hal_linux/sys.h"

#define CONSUMER "turbopi"

static struct gpiod_line_request *native(struct gpio_line *line)
{
    return (struct gpiod_line_request *)line;
}

static struct gpiod_line_request *request_line(struct gpiod_chip *chip, unsigned offset,
                                               struct gpiod_line_settings *settings)
{
    struct gpiod_line_request *request = NULL;
    struct gpiod_line_config *lines = gpiod_line_config_new();
    struct gpiod_request_config *consumer = gpiod_request_config_new();
    if (lines != NULL && consumer != NULL)
    {
        gpiod_request_config_set_consumer(consumer, CONSUMER);
        if (gpiod_line_config_add_line_settings(lines, &offset, 1, settings) == 0)
        {
            request = gpiod_chip_request_lines(chip, consumer, lines);
        }
    }
    const int error_number = errno;
    gpiod_request_config_free(consumer);
    gpiod_line_config_free(lines);
    errno = error_number;
    return request;
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
    struct gpiod_line_request *request = NULL;
    struct gpiod_line_settings *settings = gpiod_line_settings_new();
    if (settings != NULL &&
        gpiod_line_settings_set_direction(
            settings, output ? GPIOD_LINE_DIRECTION_OUTPUT : GPIOD_LINE_DIRECTION_INPUT) == 0 &&
        (output || gpiod_line_settings_set_bias(settings, GPIOD_LINE_BIAS_PULL_UP) == 0))
    {
        request = request_line(chip, offset, settings);
    }
    const enum fw_err err = request != NULL ? FW_OK : hal_sys_err(errno);
    gpiod_line_settings_free(settings);
    // The request outlives the chip.
    gpiod_chip_close(chip);
    *line = (struct gpio_line *)request;
    return err;
}

enum fw_err gpio_line_open_input(const char *chip, unsigned offset, struct gpio_line **line)
{
    return open_line(chip, offset, false, line);
}

enum fw_err gpio_line_open_output(const char *chip, unsigned offset, struct gpio_line **line)
{
    return open_line(chip, offset, true, line);
}

static enum fw_err only_offset(struct gpio_line *line, unsigned *offset)
{
    return gpiod_line_request_get_requested_offsets(native(line), offset, 1) == 1 ? FW_OK
                                                                                  : FW_ERR_IO;
}

enum fw_err gpio_line_get(struct gpio_line *line, bool *high)
{
    unsigned offset;
    if (only_offset(line, &offset) != FW_OK)
    {
        return FW_ERR_IO;
    }
    const enum gpiod_line_value value = gpiod_line_request_get_value(native(line), offset);
    if (value == GPIOD_LINE_VALUE_ERROR)
    {
        return hal_sys_err(errno);
    }
    *high = value == GPIOD_LINE_VALUE_ACTIVE;
    return FW_OK;
}

enum fw_err gpio_line_set(struct gpio_line *line, bool high)
{
    unsigned offset;
    if (only_offset(line, &offset) != FW_OK)
    {
        return FW_ERR_IO;
    }
    const enum gpiod_line_value value = high ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
    return gpiod_line_request_set_value(native(line), offset, value) == 0 ? FW_OK
                                                                          : hal_sys_err(errno);
}

void gpio_line_close(struct gpio_line *line)
{
    if (line != NULL)
    {
        gpiod_line_request_release(native(line));
    }
}

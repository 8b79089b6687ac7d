// SPDX-License-Identifier: Apache-2.0
#include "hal_linux/panel_gpio.h"

#include <stddef.h>

#include "gpio_line.h"
#include "hal_linux/gpio_chip.h"

static void release_lines(struct panel_gpio *panel)
{
    for (int i = 0; i < PANEL_GPIO_COUNT; ++i)
    {
        gpio_line_close(panel->lines[i]);
        panel->lines[i] = NULL;
    }
    panel->shown = (struct hal_lights){0};
}

// The chip is looked for each time: what is plugged in later has another number.
static enum fw_err reserve_lines(struct panel_gpio *panel)
{
    if (panel->lines[PANEL_GPIO_BUTTON] != NULL)
    {
        return FW_OK;
    }
    char found[GPIO_CHIP_PATH_MAX];
    const bool is_path = panel->config.chip[0] == '/';
    const char *chip = is_path ? panel->config.chip : found;
    enum fw_err err = is_path ? FW_OK : gpio_chip_find(panel->sys, panel->config.chip, found);
    for (int i = 0; i < PANEL_GPIO_COUNT && err == FW_OK; ++i)
    {
        const unsigned offset = panel->config.offset[i];
        err = i == PANEL_GPIO_BUTTON ? gpio_line_open_input(chip, offset, &panel->lines[i])
                                     : gpio_line_open_output(chip, offset, &panel->lines[i]);
    }
    if (err != FW_OK)
    {
        release_lines(panel);
    }
    return err;
}

static enum fw_err read_button(void *device, bool *pressed)
{
    struct panel_gpio *panel = device;
    enum fw_err err = reserve_lines(panel);
    if (err != FW_OK)
    {
        return err;
    }
    bool high;
    err = gpio_line_get(panel->lines[PANEL_GPIO_BUTTON], &high);
    if (err != FW_OK)
    {
        release_lines(panel);
        return err;
    }
    *pressed = !high;
    return FW_OK;
}

static enum fw_err set_if_changed(struct gpio_line *line, bool *shown, bool wanted)
{
    if (*shown == wanted)
    {
        return FW_OK;
    }
    const enum fw_err err = gpio_line_set(line, wanted);
    if (err == FW_OK)
    {
        *shown = wanted;
    }
    return err;
}

static enum fw_err show(void *device, const struct hal_lights *lights)
{
    struct panel_gpio *panel = device;
    enum fw_err err = reserve_lines(panel);
    if (err != FW_OK)
    {
        return err;
    }
    const struct
    {
        bool *shown;
        bool wanted;
    } changes[PANEL_GPIO_COUNT] = {
        [PANEL_GPIO_DETECTED] = {&panel->shown.detected, lights->detected},
        [PANEL_GPIO_RUNNING] = {&panel->shown.running, lights->running},
        [PANEL_GPIO_BUZZER] = {&panel->shown.buzzer, lights->buzzer},
    };
    for (int i = PANEL_GPIO_DETECTED; i < PANEL_GPIO_COUNT && err == FW_OK; ++i)
    {
        err = set_if_changed(panel->lines[i], changes[i].shown, changes[i].wanted);
    }
    if (err != FW_OK)
    {
        release_lines(panel);
    }
    return err;
}

static void close_panel(void *device)
{
    struct panel_gpio *panel = device;
    const struct hal_lights off = {0};
    if (panel->lines[PANEL_GPIO_BUTTON] != NULL && show(panel, &off) != FW_OK)
    {
        return;  // show() has released the lines
    }
    release_lines(panel);
}

struct hal_panel panel_gpio_make(struct panel_gpio *panel, const struct panel_gpio_config *config,
                                 const struct hal_sys *sys)
{
    static const struct hal_panel_ops ops = {read_button, show, close_panel};
    *panel = (struct panel_gpio){.config = *config, .sys = sys};
    return (struct hal_panel){.device = panel, .ops = &ops};
}

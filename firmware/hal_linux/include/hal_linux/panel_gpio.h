// SPDX-License-Identifier: Apache-2.0
// Button, LEDs and buzzer on GPIO lines, through libgpiod.
#ifndef HAL_LINUX_PANEL_GPIO_H
#define HAL_LINUX_PANEL_GPIO_H

#include <stdbool.h>

#include "hal/panel.h"
#include "hal_linux/sys.h"

enum panel_gpio_line
{
    PANEL_GPIO_BUTTON,
    PANEL_GPIO_DETECTED,
    PANEL_GPIO_RUNNING,
    PANEL_GPIO_BUZZER,
    PANEL_GPIO_COUNT,
};

struct panel_gpio_config
{
    // A path, such as /dev/gpiochip0, or a label: see gpio_chip.h.
    const char *chip;
    // Lines of the chip by enum panel_gpio_line; the button is low while pressed.
    unsigned offset[PANEL_GPIO_COUNT];
};

struct gpio_line;

// Only panel_gpio.c looks inside.
struct panel_gpio
{
    struct panel_gpio_config config;
    const struct hal_sys *sys;
    struct gpio_line *lines[PANEL_GPIO_COUNT];
    struct hal_lights shown;
};

// Lines are reserved at the first use, and again after a failure. libgpiod takes heap for it.
// @param panel lives as long as the result. @param config its chip is not copied.
struct hal_panel panel_gpio_make(struct panel_gpio *panel, const struct panel_gpio_config *config,
                                 const struct hal_sys *sys);

#endif

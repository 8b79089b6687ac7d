// SPDX-License-Identifier: Apache-2.0
#include "hal_linux/gpio_chip.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#define CHIPS_MAX 32

// The kernel's names for what drives the header: Pi 5, Pi 4, and older ones, a Zero 2 among them.
static const char *const header_labels[] = {"pinctrl-rp1", "pinctrl-bcm2711", "pinctrl-bcm2835"};

static bool is_wanted(const char *wanted, const char *label)
{
    if (strcmp(wanted, "auto") != 0)
    {
        return strcmp(wanted, label) == 0;
    }
    for (size_t i = 0; i < sizeof header_labels / sizeof header_labels[0]; ++i)
    {
        if (strcmp(header_labels[i], label) == 0)
        {
            return true;
        }
    }
    return false;
}

// @return 0 or an errno.
static int read_label(const struct hal_sys *sys, const char *path, struct gpiochip_info *info)
{
    *info = (struct gpiochip_info){0};
    const int fd = sys->open(path, O_RDWR);
    if (fd < 0)
    {
        return errno;
    }
    const int error_number = sys->ioctl(fd, GPIO_GET_CHIPINFO_IOCTL, info) == 0 ? 0 : errno;
    (void)sys->close(fd);
    info->label[sizeof info->label - 1] = '\0';
    return error_number;
}

enum fw_err gpio_chip_find(const struct hal_sys *sys, const char *label,
                           char path[GPIO_CHIP_PATH_MAX])
{
    enum fw_err err = FW_ERR_NO_DEVICE;
    for (int i = 0; i < CHIPS_MAX; ++i)
    {
        struct gpiochip_info info;
        (void)snprintf(path, GPIO_CHIP_PATH_MAX, "/dev/gpiochip%d", i);
        const int error_number = read_label(sys, path, &info);
        if (error_number == 0 && is_wanted(label, info.label))
        {
            return FW_OK;
        }
        if (error_number != 0 && error_number != ENOENT)
        {
            err = hal_sys_err(error_number);
        }
    }
    return err;
}

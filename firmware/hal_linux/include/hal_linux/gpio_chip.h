// SPDX-License-Identifier: Apache-2.0
// Which GPIO chip has the robot's lines: their numbers differ between computers and kernels.
#ifndef HAL_LINUX_GPIO_CHIP_H
#define HAL_LINUX_GPIO_CHIP_H

#include "fw/err.h"
#include "hal_linux/sys.h"

#define GPIO_CHIP_PATH_MAX 32

// Finds the chip by what the kernel calls it.
// @param label as gpiodetect prints it, or "auto": that of a Raspberry Pi's header, whichever Pi it
// is.
// @param path of the chip on success, as /dev/gpiochip0.
// @return FW_OK; FW_ERR_NO_DEVICE: there is none; FW_ERR_IO: those that are there may not be read.
enum fw_err FW_MUST_CHECK gpio_chip_find(const struct hal_sys *sys, const char *label,
                                         char path[GPIO_CHIP_PATH_MAX]);

#endif

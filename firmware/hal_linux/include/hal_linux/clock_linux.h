// SPDX-License-Identifier: Apache-2.0
// CLOCK_MONOTONIC, CLOCK_REALTIME and poll().
#ifndef HAL_LINUX_CLOCK_LINUX_H
#define HAL_LINUX_CLOCK_LINUX_H

#include "hal/clock.h"

struct hal_clock clock_linux(void);

#endif

// SPDX-License-Identifier: Apache-2.0
// Voltage of the battery pack, two cells in series.
#ifndef HAL_BATTERY_H
#define HAL_BATTERY_H

#include <stdint.h>

#include "fw/err.h"

#ifdef __cplusplus
extern "C" {
#endif

struct hal_battery_ops
{
    enum fw_err (*read)(void *device, int32_t *pack_mV);
};

struct hal_battery
{
    void *device;
    const struct hal_battery_ops *ops;
};

// @param pack_mV untouched on failure.
// @return FW_OK, FW_ERR_TIMEOUT (not known yet), FW_ERR_NO_DEVICE or FW_ERR_IO.
static inline enum fw_err FW_MUST_CHECK hal_battery_read(const struct hal_battery *battery,
                                                         int32_t *pack_mV)
{
    return battery->ops->read(battery->device, pack_mV);
}

#ifdef __cplusplus
}
#endif

#endif

// SPDX-License-Identifier: Apache-2.0
// What a person next to the robot sees, hears and presses.
#ifndef HAL_PANEL_H
#define HAL_PANEL_H

#include <stdbool.h>

#include "fw/err.h"

#ifdef __cplusplus
extern "C" {
#endif

struct hal_lights
{
    bool detected;
    bool running;
    bool buzzer;
};

struct hal_panel_ops
{
    enum fw_err (*read_button)(void *device, bool *pressed);
    enum fw_err (*show)(void *device, const struct hal_lights *lights);
    void (*close)(void *device);
};

struct hal_panel
{
    void *device;
    const struct hal_panel_ops *ops;
};

// The start/stop button, not debounced. @return FW_OK, FW_ERR_NO_DEVICE or FW_ERR_IO.
static inline enum fw_err FW_MUST_CHECK hal_panel_read_button(const struct hal_panel *panel,
                                                              bool *pressed)
{
    return panel->ops->read_button(panel->device, pressed);
}

// @return FW_OK, FW_ERR_NO_DEVICE or FW_ERR_IO.
static inline enum fw_err FW_MUST_CHECK hal_panel_show(const struct hal_panel *panel,
                                                       const struct hal_lights *lights)
{
    return panel->ops->show(panel->device, lights);
}

// Lights and buzzer off, lines given back.
static inline void hal_panel_close(const struct hal_panel *panel)
{
    panel->ops->close(panel->device);
}

#ifdef __cplusplus
}
#endif

#endif

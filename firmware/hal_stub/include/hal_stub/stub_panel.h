// SPDX-License-Identifier: Apache-2.0
// A panel whose button a test presses and whose lights it reads.
#ifndef HAL_STUB_STUB_PANEL_H
#define HAL_STUB_STUB_PANEL_H

#include "hal/panel.h"
#include "hal_stub/stub_faults.h"

struct stub_panel
{
    struct stub_faults *faults;
    bool pressed;
    struct hal_lights shown;
};

// @param panel lives as long as the result.
struct hal_panel stub_panel_make(struct stub_panel *panel);

#endif

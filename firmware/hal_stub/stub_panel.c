// SPDX-License-Identifier: Apache-2.0
#include "hal_stub/stub_panel.h"

static enum fw_err read_button(void *device, bool *pressed)
{
    const struct stub_panel *panel = device;
    const enum fw_err err = stub_faults_next(panel->faults);
    if (err == FW_OK)
    {
        *pressed = panel->pressed;
    }
    return err;
}

static enum fw_err show(void *device, const struct hal_lights *lights)
{
    struct stub_panel *panel = device;
    const enum fw_err err = stub_faults_next(panel->faults);
    if (err == FW_OK)
    {
        panel->shown = *lights;
    }
    return err;
}

static void close_panel(void *device)
{
    ((struct stub_panel *)device)->shown = (struct hal_lights){0};
}

struct hal_panel stub_panel_make(struct stub_panel *panel)
{
    static const struct hal_panel_ops ops = {read_button, show, close_panel};
    return (struct hal_panel){.device = panel, .ops = &ops};
}

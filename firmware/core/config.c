// SPDX-License-Identifier: Apache-2.0
#include "fw/config.h"

#include "fw/behavior.h"
#include "fw/mixing.h"

struct fw_config fw_config_default(void)
{
    return (struct fw_config){.width_px = 640,
                              .height_px = 480,
                              .bit_count = 1,
                              .bits = {fw_bit_default()},
                              .table = fw_behavior_find("milling")->table,
                              .frame_timeout_us = 200000,
                              .duty_cap_pct = FW_DUTY_MAX_PCT};
}

enum fw_err fw_config_check(const struct fw_config *config)
{
    if (config->width_px < 2 || config->width_px > FW_MAX_WIDTH_PX || config->width_px % 2 != 0 ||
        config->height_px < 1 || config->height_px > FW_MAX_HEIGHT_PX)
    {
        return FW_ERR_FRAME_SIZE;
    }
    if (config->frame_timeout_us <= 0)
    {
        return FW_ERR_FRAME_TIMEOUT;
    }
    if (config->duty_cap_pct < 0 || config->duty_cap_pct > FW_DUTY_MAX_PCT)
    {
        return FW_ERR_DUTY_CAP;
    }
    if (config->bit_count < config->table.bit_count || config->bit_count > FW_MAX_BITS)
    {
        return FW_ERR_BITS;
    }
    enum fw_err err = FW_OK;
    for (int i = 0; err == FW_OK && i < config->bit_count; ++i)
    {
        err = fw_bit_check(&config->bits[i]);
    }
    return err != FW_OK ? err : fw_table_check(&config->table);
}

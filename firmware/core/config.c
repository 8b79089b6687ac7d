// SPDX-License-Identifier: Apache-2.0
#include "fw/config.h"

#include "fw/behavior.h"
#include "fw/mixing.h"

struct fw_config fw_config_default(void)
{
    return (struct fw_config){.width_px = 640,
                              .height_px = 480,
                              .box = fw_color_box_green(),
                              .min_blob_px = 300,
                              .vote = fw_vote_config_default(),
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
    const struct fw_color_box *box = &config->box;
    if (box->y_min > box->y_max || box->u_min > box->u_max || box->v_min > box->v_max)
    {
        return FW_ERR_BOX;
    }
    if (config->min_blob_px < 0)
    {
        return FW_ERR_MIN_BLOB;
    }
    if (config->frame_timeout_us <= 0)
    {
        return FW_ERR_FRAME_TIMEOUT;
    }
    if (config->duty_cap_pct < 0 || config->duty_cap_pct > FW_DUTY_MAX_PCT)
    {
        return FW_ERR_DUTY_CAP;
    }
    const enum fw_err err = fw_vote_check(&config->vote);
    return err != FW_OK ? err : fw_table_check(&config->table);
}

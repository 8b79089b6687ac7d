// SPDX-License-Identifier: Apache-2.0
// What would a TurboPi do with this picture? decide FRAME.yuyv (640x480, YUYV, as v4l2-ctl saves
// it)
#include <inttypes.h>
#include <stdio.h>

#include "fw/step.h"

int main(int argc, char **argv)
{
    static uint8_t yuyv[640 * 480 * 2];
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    if (!file || fread(yuyv, 1, sizeof yuyv, file) != sizeof yuyv)
    {
        fprintf(stderr, "decide: give a file of one 640x480 frame in YUYV (614400 bytes)\n");
        return 1;
    }
    fclose(file);

    static struct fw_ctx robot;
    const struct fw_config config = fw_config_default();
    const enum fw_err error = fw_init(&robot, &config);
    if (error != FW_OK)
    {
        fprintf(stderr, "decide: %s\n", fw_err_str(error));
        return 1;
    }
    const struct fw_frame frame = {.yuyv = yuyv,
                                   .width_px = 640,
                                   .height_px = 480,
                                   .stride_bytes = 2 * 640,
                                   .utime_us = 1000,
                                   .seq = 1,
                                   .length_bytes = sizeof yuyv};
    struct fw_output out;
    fw_step(&robot, &frame, 2000, &out);
    printf("blob %" PRId32 " px, bit %d, duties %d %d %d %d %%\n", out.blob_px, out.detected,
           out.wheel_duty_pct[FW_FRONT_LEFT], out.wheel_duty_pct[FW_FRONT_RIGHT],
           out.wheel_duty_pct[FW_REAR_LEFT], out.wheel_duty_pct[FW_REAR_RIGHT]);
    return 0;
}

// SPDX-License-Identifier: Apache-2.0
// Prints the duties that the core alone decides for each frame of a file:
// core_duties FILE WIDTH_PX HEIGHT_PX. Frames are bare YUYV rows, 10 ms apart.
#include <stdio.h>
#include <stdlib.h>

#include "fw/step.h"

#define PERIOD_US 10000

int main(int argc, char **argv)
{
    struct fw_config config = fw_config_default();
    config.width_px = argc == 4 ? atoi(argv[2]) : 0;
    config.height_px = argc == 4 ? atoi(argv[3]) : 0;
    static struct fw_ctx core;
    FILE *file = argc == 4 ? fopen(argv[1], "rb") : NULL;
    if (file == NULL || fw_init(&core, &config) != FW_OK)
    {
        fputs("usage: core_duties FILE WIDTH_PX HEIGHT_PX\n", stderr);
        return 2;
    }
    static uint8_t yuyv[2 * FW_MAX_WIDTH_PX * FW_MAX_HEIGHT_PX];
    const size_t bytes = 2 * (size_t)config.width_px * (size_t)config.height_px;
    for (uint32_t seq = 0; fread(yuyv, bytes, 1, file) == 1; ++seq)
    {
        const int64_t now_us = ((int64_t)seq + 1) * PERIOD_US;
        const struct fw_frame frame = {.yuyv = yuyv,
                                       .width_px = config.width_px,
                                       .height_px = config.height_px,
                                       .stride_bytes = 2 * config.width_px,
                                       .utime_us = now_us,
                                       .seq = seq,
                                       .length_bytes = bytes};
        struct fw_output out;
        fw_step(&core, &frame, now_us, &out);
        printf("%d %d %d %d\n", out.wheel_duty_pct[0], out.wheel_duty_pct[1], out.wheel_duty_pct[2],
               out.wheel_duty_pct[3]);
    }
    fclose(file);
    return 0;
}

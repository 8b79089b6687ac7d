// SPDX-License-Identifier: Apache-2.0
#include "stub_camera_shared.h"

#include <string.h>

void stub_camera_init(struct stub_camera *camera, const struct stub_camera_config *config,
                      const struct hal_clock *clock, struct stub_faults *faults)
{
    // The frame's bytes stay untouched: pages that no frame needs are never there.
    memset(camera, 0, offsetof(struct stub_camera, frame));
    camera->config = *config;
    camera->clock = *clock;
    camera->faults = faults;
    camera->fd = -1;
}

size_t stub_camera_frame_bytes(const struct stub_camera *camera)
{
    return 2 * (size_t)camera->config.width_px * (size_t)camera->config.height_px;
}

void stub_camera_give(struct stub_camera *camera, const uint8_t *yuyv, struct fw_frame *frame)
{
    *frame = (struct fw_frame){
        .yuyv = yuyv,
        .width_px = camera->config.width_px,
        .height_px = camera->config.height_px,
        .stride_bytes = 2 * camera->config.width_px,
        .utime_us = hal_clock_monotonic_us(&camera->clock),
        .seq = camera->seq++,
        .length_bytes = stub_camera_frame_bytes(camera),
    };
    ++camera->stats.taken_count;
}

int stub_camera_fd(const void *device)
{
    return ((const struct stub_camera *)device)->fd;
}

void stub_camera_stats(const void *device, struct hal_camera_stats *stats)
{
    *stats = ((const struct stub_camera *)device)->stats;
}

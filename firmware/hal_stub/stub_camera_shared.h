// SPDX-License-Identifier: Apache-2.0
// What both stub cameras share.
#ifndef STUB_CAMERA_SHARED_H
#define STUB_CAMERA_SHARED_H

#include "hal_stub/stub_camera.h"

void stub_camera_init(struct stub_camera *camera, const struct stub_camera_config *config,
                      const struct hal_clock *clock, struct stub_faults *faults);
size_t stub_camera_frame_bytes(const struct stub_camera *camera);
// Gives out the next frame.
void stub_camera_give(struct stub_camera *camera, const uint8_t *yuyv, struct fw_frame *frame);
int stub_camera_fd(const void *device);
void stub_camera_stats(const void *device, struct hal_camera_stats *stats);

#endif

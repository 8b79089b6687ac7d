// SPDX-License-Identifier: Apache-2.0
// A camera behind V4L2, streamed through buffers that driver and program share. Pictures in
// Motion-JPEG are decoded, which takes heap.
#ifndef HAL_LINUX_CAMERA_V4L2_H
#define HAL_LINUX_CAMERA_V4L2_H

#include <stdbool.h>

#include "hal/camera.h"
#include "hal/clock.h"
#include "hal_linux/sys.h"

#define CAMERA_V4L2_MAX_BUFFERS 4

struct camera_v4l2_config
{
    const char *path;
    // What is asked for; the nearest that the camera has is taken.
    int width_px, height_px, rate_Hz;
    // Exposure time in 100 us and white balance in kelvin, where the camera has the control:
    // above 0 it is set, 0 locks what the camera has now, -1 leaves it automatic.
    int exposure_100us, white_balance_K;
};

struct camera_v4l2_buffer
{
    void *bytes;
    size_t length_bytes;
};

// Only camera_v4l2.c looks inside.
struct camera_v4l2
{
    struct camera_v4l2_config config;
    struct hal_clock clock;
    const struct hal_sys *sys;
    int fd;
    int width_px, height_px, stride_bytes;
    // The camera sends Motion-JPEG alone: each picture is decoded here.
    bool is_mjpg;
    uint8_t *decoded;
    bool streaming;
    struct camera_v4l2_buffer buffers[CAMERA_V4L2_MAX_BUFFERS];
    unsigned buffer_count;
    // The buffer that the application has, or -1.
    int held;
    // Sequence number that comes next without a gap.
    bool has_sequence;
    uint32_t next_sequence;
    struct hal_camera_stats stats;
};

// @param camera lives as long as the result. @param config its path is not copied.
struct hal_camera camera_v4l2_make(struct camera_v4l2 *camera,
                                   const struct camera_v4l2_config *config,
                                   const struct hal_clock *clock, const struct hal_sys *sys);

// Negotiates YUYV, or else Motion-JPEG, size and rate, and locks the controls that exist, on an
// open device. Fills width_px, height_px, stride_bytes and is_mjpg with what the camera will send.
// @return FW_OK, FW_ERR_NO_DEVICE, FW_ERR_FORMAT or FW_ERR_IO.
enum fw_err FW_MUST_CHECK camera_v4l2_setup(struct camera_v4l2 *camera);

#endif

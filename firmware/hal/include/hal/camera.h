// SPDX-License-Identifier: Apache-2.0
// A camera that gives YUYV frames, whatever delivers them.
#ifndef HAL_CAMERA_H
#define HAL_CAMERA_H

#include "fw/err.h"
#include "fw/frame.h"

#ifdef __cplusplus
extern "C" {
#endif

// What the camera really sends, which need not be what it was asked for.
struct hal_camera_format
{
    int width_px, height_px;
};

// Counts since the program began; they survive closing and opening again.
struct hal_camera_stats
{
    // Frames that the application took.
    uint32_t taken_count;
    // Gaps in the camera's sequence numbers, and frames that a newer one overtook.
    uint32_t dropped_count;
    // Frames that the driver marked as damaged.
    uint32_t damaged_count;
};

struct hal_camera_ops
{
    enum fw_err (*open)(void *device, struct hal_camera_format *format);
    enum fw_err (*take)(void *device, struct fw_frame *frame);
    void (*close)(void *device);
    int (*fd)(const void *device);
    void (*stats)(const void *device, struct hal_camera_stats *stats);
};

struct hal_camera
{
    void *device;
    const struct hal_camera_ops *ops;
};

// Starts the stream. @return FW_OK, FW_ERR_NO_DEVICE, FW_ERR_FORMAT (no YUYV of a size that the
// core can read) or FW_ERR_IO; after an error the camera is closed.
static inline enum fw_err FW_MUST_CHECK hal_camera_open(const struct hal_camera *camera,
                                                        struct hal_camera_format *format)
{
    return camera->ops->open(camera->device, format);
}

// Takes the newest frame without waiting. Its bytes stay valid until the next call.
// @return FW_OK, FW_ERR_TIMEOUT (none yet), FW_ERR_NO_DEVICE (gone: close, open again later),
// FW_ERR_IO (the same), FW_ERR_END (a recording is over).
static inline enum fw_err FW_MUST_CHECK hal_camera_take(const struct hal_camera *camera,
                                                        struct fw_frame *frame)
{
    return camera->ops->take(camera->device, frame);
}

// Inverse of hal_camera_open(); does nothing to a closed camera.
static inline void hal_camera_close(const struct hal_camera *camera)
{
    camera->ops->close(camera->device);
}

// @return a descriptor that is readable when a frame can be taken; -1 if there is none.
static inline int hal_camera_fd(const struct hal_camera *camera)
{
    return camera->ops->fd(camera->device);
}

static inline void hal_camera_stats(const struct hal_camera *camera, struct hal_camera_stats *stats)
{
    camera->ops->stats(camera->device, stats);
}

#ifdef __cplusplus
}
#endif

#endif

// SPDX-License-Identifier: Apache-2.0
// Cameras without a lens: one plays a file, the other what a program sends through a socket. Both
// give frames of bare YUYV rows, and stamp each when it is taken.
#ifndef HAL_STUB_STUB_CAMERA_H
#define HAL_STUB_STUB_CAMERA_H

#include <stdbool.h>

#include "hal/camera.h"
#include "hal/clock.h"
#include "hal_stub/stub_faults.h"

#define STUB_CAMERA_MAX_BYTES (2 * FW_MAX_WIDTH_PX * FW_MAX_HEIGHT_PX)

struct stub_camera_config
{
    // A file of whole frames, or a Unix socket (stream) that the sender listens at.
    const char *path;
    int width_px, height_px;
    // File: frames a second; 0 gives one at every take, for tests that move the clock by hand.
    int rate_Hz;
};

struct stub_camera
{
    struct stub_camera_config config;
    struct hal_clock clock;
    struct stub_faults *faults;
    // File: the timer that paces it. Socket: the connection. -1 if there is none.
    int fd;
    bool is_open;
    // File: the whole of it, mapped.
    const uint8_t *file;
    size_t file_bytes;
    uint32_t seq;
    // Socket: the frame that is arriving.
    size_t received_bytes;
    struct hal_camera_stats stats;
    uint8_t frame[STUB_CAMERA_MAX_BYTES];
};

// FW_ERR_END after the file's last frame. @param camera lives as long as the result; it is large,
// so let it be static. @param config its path is not copied. @param faults may be NULL.
struct hal_camera stub_camera_file(struct stub_camera *camera,
                                   const struct stub_camera_config *config,
                                   const struct hal_clock *clock, struct stub_faults *faults);

// FW_ERR_NO_DEVICE when the sender hangs up, as from a camera that was unplugged.
struct hal_camera stub_camera_socket(struct stub_camera *camera,
                                     const struct stub_camera_config *config,
                                     const struct hal_clock *clock, struct stub_faults *faults);

#endif

// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <stdbool.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include "stub_camera_shared.h"

static void close_file(void *device)
{
    struct stub_camera *camera = device;
    if (!camera->is_open)
    {
        return;
    }
    (void)munmap((void *)(uintptr_t)camera->file, camera->file_bytes);
    if (camera->fd >= 0)
    {
        (void)close(camera->fd);
        camera->fd = -1;
    }
    camera->is_open = false;
}

static enum fw_err map_file(struct stub_camera *camera)
{
    const int fd = open(camera->config.path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
    {
        return FW_ERR_NO_DEVICE;
    }
    struct stat status;
    const bool fits = fstat(fd, &status) == 0 &&
                      (size_t)status.st_size >= stub_camera_frame_bytes(camera) &&
                      (size_t)status.st_size % stub_camera_frame_bytes(camera) == 0;
    enum fw_err err = FW_ERR_FORMAT;
    if (fits)
    {
        camera->file_bytes = (size_t)status.st_size;
        camera->file = mmap(NULL, camera->file_bytes, PROT_READ, MAP_PRIVATE, fd, 0);
        err = camera->file == MAP_FAILED ? FW_ERR_IO : FW_OK;
    }
    (void)close(fd);
    return err;
}

static enum fw_err start_timer(struct stub_camera *camera)
{
    const long period_ns = 1000000000 / camera->config.rate_Hz;
    const struct timespec period = {.tv_sec = period_ns / 1000000000,
                                    .tv_nsec = period_ns % 1000000000};
    const struct itimerspec every = {.it_interval = period, .it_value = period};
    camera->fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    return camera->fd >= 0 && timerfd_settime(camera->fd, 0, &every, NULL) == 0 ? FW_OK : FW_ERR_IO;
}

static enum fw_err open_file(void *device, struct hal_camera_format *format)
{
    struct stub_camera *camera = device;
    enum fw_err err = stub_faults_next(camera->faults);
    if (err == FW_OK)
    {
        err = map_file(camera);
    }
    if (err != FW_OK)
    {
        return err;
    }
    camera->is_open = true;
    if (camera->config.rate_Hz > 0)
    {
        err = start_timer(camera);
    }
    if (err != FW_OK)
    {
        close_file(camera);
        return err;
    }
    *format = (struct hal_camera_format){camera->config.width_px, camera->config.height_px};
    return FW_OK;
}

// The file goes on where it was if the camera was closed and opened again.
static enum fw_err take(void *device, struct fw_frame *frame)
{
    struct stub_camera *camera = device;
    const enum fw_err err = stub_faults_next(camera->faults);
    if (err != FW_OK)
    {
        return err;
    }
    uint64_t ticks;
    if (camera->fd >= 0 && read(camera->fd, &ticks, sizeof ticks) != sizeof ticks)
    {
        return FW_ERR_TIMEOUT;
    }
    const size_t frame_bytes = stub_camera_frame_bytes(camera);
    if (camera->seq >= camera->file_bytes / frame_bytes)
    {
        return FW_ERR_END;
    }
    stub_camera_give(camera, camera->file + camera->seq * frame_bytes, frame);
    return FW_OK;
}

struct hal_camera stub_camera_file(struct stub_camera *camera,
                                   const struct stub_camera_config *config,
                                   const struct hal_clock *clock, struct stub_faults *faults)
{
    static const struct hal_camera_ops ops = {open_file, take, close_file, stub_camera_fd,
                                              stub_camera_stats};
    stub_camera_init(camera, config, clock, faults);
    return (struct hal_camera){.device = camera, .ops = &ops};
}

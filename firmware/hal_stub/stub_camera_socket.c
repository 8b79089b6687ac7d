// SPDX-License-Identifier: Apache-2.0
#include <errno.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "stub_camera_shared.h"

static void close_socket(void *device)
{
    struct stub_camera *camera = device;
    if (camera->fd >= 0)
    {
        (void)close(camera->fd);
        camera->fd = -1;
    }
    camera->received_bytes = 0;
}

static enum fw_err open_socket(void *device, struct hal_camera_format *format)
{
    struct stub_camera *camera = device;
    const enum fw_err err = stub_faults_next(camera->faults);
    if (err != FW_OK)
    {
        return err;
    }
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (strlen(camera->config.path) >= sizeof address.sun_path)
    {
        return FW_ERR_NO_DEVICE;
    }
    strcpy(address.sun_path, camera->config.path);
    camera->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (camera->fd < 0 ||
        connect(camera->fd, (const struct sockaddr *)&address, sizeof address) != 0)
    {
        close_socket(camera);
        return FW_ERR_NO_DEVICE;
    }
    *format = (struct hal_camera_format){camera->config.width_px, camera->config.height_px};
    return FW_OK;
}

static enum fw_err take(void *device, struct fw_frame *frame)
{
    struct stub_camera *camera = device;
    const enum fw_err err = stub_faults_next(camera->faults);
    if (err != FW_OK)
    {
        return err;
    }
    const size_t frame_bytes = stub_camera_frame_bytes(camera);
    while (camera->received_bytes < frame_bytes)
    {
        const ssize_t got = recv(camera->fd, camera->frame + camera->received_bytes,
                                 frame_bytes - camera->received_bytes, 0);
        if (got < 0 && (errno == EAGAIN || errno == EINTR))
        {
            return FW_ERR_TIMEOUT;
        }
        if (got <= 0)
        {
            return FW_ERR_NO_DEVICE;
        }
        camera->received_bytes += (size_t)got;
    }
    camera->received_bytes = 0;
    stub_camera_give(camera, camera->frame, frame);
    return FW_OK;
}

struct hal_camera stub_camera_socket(struct stub_camera *camera,
                                     const struct stub_camera_config *config,
                                     const struct hal_clock *clock, struct stub_faults *faults)
{
    static const struct hal_camera_ops ops = {open_socket, take, close_socket, stub_camera_fd,
                                              stub_camera_stats};
    stub_camera_init(camera, config, clock, faults);
    return (struct hal_camera){.device = camera, .ops = &ops};
}

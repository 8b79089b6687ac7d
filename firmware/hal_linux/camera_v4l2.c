// SPDX-License-Identifier: Apache-2.0
#include "hal_linux/camera_v4l2.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "hal_linux/mjpg.h"

static int call(struct camera_v4l2 *camera, unsigned long request, void *argument)
{
    return camera->sys->ioctl(camera->fd, request, argument);
}

static struct v4l2_buffer buffer_of(unsigned index)
{
    return (struct v4l2_buffer){
        .index = index, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
}

static enum fw_err enqueue(struct camera_v4l2 *camera, unsigned index)
{
    struct v4l2_buffer buffer = buffer_of(index);
    return call(camera, VIDIOC_QBUF, &buffer) == 0 ? FW_OK : hal_sys_err(errno);
}

static enum fw_err request_buffers(struct camera_v4l2 *camera, unsigned count)
{
    struct v4l2_requestbuffers request = {
        .count = count, .type = V4L2_BUF_TYPE_VIDEO_CAPTURE, .memory = V4L2_MEMORY_MMAP};
    if (call(camera, VIDIOC_REQBUFS, &request) != 0)
    {
        return hal_sys_err(errno);
    }
    camera->buffer_count =
        request.count < CAMERA_V4L2_MAX_BUFFERS ? request.count : CAMERA_V4L2_MAX_BUFFERS;
    // One is held, one is filled.
    return count == 0 || camera->buffer_count >= 2 ? FW_OK : FW_ERR_IO;
}

static enum fw_err map_buffers(struct camera_v4l2 *camera)
{
    for (unsigned i = 0; i < camera->buffer_count; ++i)
    {
        struct v4l2_buffer buffer = buffer_of(i);
        if (call(camera, VIDIOC_QUERYBUF, &buffer) != 0)
        {
            return hal_sys_err(errno);
        }
        void *bytes = camera->sys->mmap(buffer.length, camera->fd, (off_t)buffer.m.offset);
        if (bytes == MAP_FAILED)
        {
            return hal_sys_err(errno);
        }
        camera->buffers[i] = (struct camera_v4l2_buffer){bytes, buffer.length};
        const enum fw_err err = enqueue(camera, i);
        if (err != FW_OK)
        {
            return err;
        }
    }
    return FW_OK;
}

static enum fw_err start_stream(struct camera_v4l2 *camera)
{
    int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (call(camera, VIDIOC_STREAMON, &type) != 0)
    {
        return hal_sys_err(errno);
    }
    camera->streaming = true;
    return FW_OK;
}

// Undoes whatever was done. Without the unmapping a driver keeps its buffers and is busy for ever.
static void close_camera(void *device)
{
    struct camera_v4l2 *camera = device;
    if (camera->fd < 0)
    {
        return;
    }
    if (camera->streaming)
    {
        int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
        (void)call(camera, VIDIOC_STREAMOFF, &type);
    }
    for (unsigned i = 0; i < CAMERA_V4L2_MAX_BUFFERS; ++i)
    {
        if (camera->buffers[i].bytes != NULL)
        {
            (void)camera->sys->munmap(camera->buffers[i].bytes, camera->buffers[i].length_bytes);
        }
    }
    if (camera->buffer_count > 0)
    {
        (void)request_buffers(camera, 0);
    }
    (void)camera->sys->close(camera->fd);
    free(camera->decoded);
    camera->decoded = NULL;
    memset(camera->buffers, 0, sizeof camera->buffers);
    camera->buffer_count = 0;
    camera->streaming = false;
    camera->fd = -1;
    camera->held = -1;
    camera->has_sequence = false;
}

static size_t yuyv_bytes(const struct camera_v4l2 *camera)
{
    return 2 * (size_t)camera->width_px * (size_t)camera->height_px;
}

// Where pictures are decoded to, if the camera sends none that can be read as they are.
static enum fw_err make_room(struct camera_v4l2 *camera)
{
    if (camera->is_mjpg)
    {
        camera->decoded = malloc(yuyv_bytes(camera));
    }
    return camera->is_mjpg && camera->decoded == NULL ? FW_ERR_IO : FW_OK;
}

static enum fw_err open_camera(void *device, struct hal_camera_format *format)
{
    struct camera_v4l2 *camera = device;
    camera->fd = camera->sys->open(camera->config.path, O_RDWR | O_NONBLOCK);
    if (camera->fd < 0)
    {
        return hal_sys_err(errno);
    }
    enum fw_err err = camera_v4l2_setup(camera);
    if (err == FW_OK)
    {
        err = make_room(camera);
    }
    if (err == FW_OK)
    {
        err = request_buffers(camera, CAMERA_V4L2_MAX_BUFFERS);
    }
    if (err == FW_OK)
    {
        err = map_buffers(camera);
    }
    if (err == FW_OK)
    {
        err = start_stream(camera);
    }
    if (err != FW_OK)
    {
        close_camera(camera);
        return err;
    }
    *format = (struct hal_camera_format){camera->width_px, camera->height_px};
    return FW_OK;
}

static void count_gap(struct camera_v4l2 *camera, uint32_t sequence)
{
    if (camera->has_sequence && sequence > camera->next_sequence)
    {
        camera->stats.dropped_count += sequence - camera->next_sequence;
    }
    camera->has_sequence = true;
    camera->next_sequence = sequence + 1;
}

// Exposure time. A frame is stamped on arrival if its driver did not stamp it by the monotonic
// clock, or with what is no time at all, or ahead of time, as drivers do that compute when a frame
// was due: what is here was not exposed later.
static int64_t utime_us(const struct camera_v4l2 *camera, const struct v4l2_buffer *buffer)
{
    const int64_t arrived_us = hal_clock_monotonic_us(&camera->clock);
    if ((buffer->flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC ||
        buffer->timestamp.tv_sec < 0 || buffer->timestamp.tv_sec > INT32_MAX ||
        buffer->timestamp.tv_usec < 0 || buffer->timestamp.tv_usec >= 1000000)
    {
        return arrived_us;
    }
    const int64_t stamp_us =
        (int64_t)buffer->timestamp.tv_sec * 1000000 + buffer->timestamp.tv_usec;
    return stamp_us < arrived_us ? stamp_us : arrived_us;
}

// Gives back what is held, then takes the newest buffer that is whole.
static enum fw_err take_newest(struct camera_v4l2 *camera, struct v4l2_buffer *newest)
{
    enum fw_err err = FW_OK;
    if (camera->held >= 0)
    {
        err = enqueue(camera, (unsigned)camera->held);
        camera->held = -1;
    }
    // Bounded, however fast frames come.
    for (unsigned tries = 0; err == FW_OK && tries < 2 * CAMERA_V4L2_MAX_BUFFERS; ++tries)
    {
        struct v4l2_buffer buffer = buffer_of(0);
        if (call(camera, VIDIOC_DQBUF, &buffer) != 0)
        {
            return errno != EAGAIN     ? hal_sys_err(errno)
                   : camera->held >= 0 ? FW_OK
                                       : FW_ERR_TIMEOUT;
        }
        if (buffer.index >= camera->buffer_count)
        {
            return FW_ERR_IO;
        }
        count_gap(camera, buffer.sequence);
        const bool damaged = buffer.flags & V4L2_BUF_FLAG_ERROR;
        camera->stats.damaged_count += damaged;
        if (damaged)
        {
            err = enqueue(camera, buffer.index);
            continue;
        }
        if (camera->held >= 0)
        {
            ++camera->stats.dropped_count;
            err = enqueue(camera, (unsigned)camera->held);
        }
        camera->held = (int)buffer.index;
        *newest = buffer;
    }
    return err != FW_OK ? err : camera->held >= 0 ? FW_OK : FW_ERR_TIMEOUT;
}

// A picture that cannot be decoded is as good as none.
static enum fw_err decode(struct camera_v4l2 *camera, struct fw_frame *frame)
{
    const enum fw_err err = mjpg_to_yuyv(frame->yuyv, frame->length_bytes, camera->width_px,
                                         camera->height_px, camera->decoded);
    if (err != FW_OK)
    {
        ++camera->stats.damaged_count;
        return FW_ERR_TIMEOUT;
    }
    frame->yuyv = camera->decoded;
    frame->length_bytes = yuyv_bytes(camera);
    return FW_OK;
}

static enum fw_err take(void *device, struct fw_frame *frame)
{
    struct camera_v4l2 *camera = device;
    struct v4l2_buffer buffer = {0};
    const enum fw_err err = take_newest(camera, &buffer);
    if (err != FW_OK)
    {
        return err;
    }
    const struct camera_v4l2_buffer *mapped = &camera->buffers[buffer.index];
    *frame = (struct fw_frame){
        .yuyv = mapped->bytes,
        .width_px = camera->width_px,
        .height_px = camera->height_px,
        .stride_bytes = camera->stride_bytes,
        .utime_us = utime_us(camera, &buffer),
        .seq = buffer.sequence,
        .length_bytes =
            buffer.bytesused < mapped->length_bytes ? buffer.bytesused : mapped->length_bytes,
    };
    const enum fw_err decoded = camera->is_mjpg ? decode(camera, frame) : FW_OK;
    camera->stats.taken_count += decoded == FW_OK;
    return decoded;
}

static int fd_of(const void *device)
{
    return ((const struct camera_v4l2 *)device)->fd;
}

static void stats_of(const void *device, struct hal_camera_stats *stats)
{
    *stats = ((const struct camera_v4l2 *)device)->stats;
}

struct hal_camera camera_v4l2_make(struct camera_v4l2 *camera,
                                   const struct camera_v4l2_config *config,
                                   const struct hal_clock *clock, const struct hal_sys *sys)
{
    static const struct hal_camera_ops ops = {open_camera, take, close_camera, fd_of, stats_of};
    *camera =
        (struct camera_v4l2){.config = *config, .clock = *clock, .sys = sys, .fd = -1, .held = -1};
    return (struct hal_camera){.device = camera, .ops = &ops};
}

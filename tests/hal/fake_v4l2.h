// SPDX-License-Identifier: Apache-2.0
// A camera as its driver shows it to a program, whose faults a test chooses.
#ifndef TESTS_HAL_FAKE_V4L2_H
#define TESTS_HAL_FAKE_V4L2_H

#include <errno.h>
#include <linux/videodev2.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#include <sys/mman.h>

#include "hal_linux/sys.h"

#define FAKE_FD 42
#define FAKE_BUFFERS 4
#define FAKE_BUFFER_BYTES (2 * 656 * 480)
#define FAKE_QUEUE 16

struct fake_arrival
{
    uint32_t sequence, flags, bytes_used;
    int64_t timestamp_us;
};

struct fake_v4l2
{
    // What the camera can do.
    uint32_t formats[2], format_count;
    uint32_t sizes[3][2], size_count;
    uint32_t padding_bytes;
    bool has_controls;

    // State of the driver.
    int open_count, mapped_count;
    bool streaming, queued[FAKE_BUFFERS];
    unsigned fifo[FAKE_BUFFERS], fifo_count;
    bool exposure_is_manual, white_balance_is_locked;
    uint8_t memory[FAKE_BUFFERS][FAKE_BUFFER_BYTES];

    // Frames that wait to be filled into queued buffers.
    struct fake_arrival arrivals[FAKE_QUEUE];
    unsigned arrival_count;

    // ioctl number fails_at (from 1) and those after it fail with fails_errno; 0: none.
    int call_count, fails_at, fails_errno;
};

static struct fake_v4l2 fake;

static void fake_reset(void)
{
    memset(&fake, 0, sizeof fake);
    fake.formats[0] = V4L2_PIX_FMT_MJPEG;
    fake.formats[1] = V4L2_PIX_FMT_YUYV;
    fake.format_count = 2;
    fake.sizes[0][0] = 320, fake.sizes[0][1] = 180;
    fake.sizes[1][0] = 640, fake.sizes[1][1] = 480;
    fake.sizes[2][0] = 1920, fake.sizes[2][1] = 1080;
    fake.size_count = 3;
    fake.has_controls = true;
}

static void fake_arrive(uint32_t sequence, uint32_t flags, uint32_t bytes_used,
                        int64_t timestamp_us)
{
    fake.arrivals[fake.arrival_count++] =
        (struct fake_arrival){sequence, flags, bytes_used, timestamp_us};
}

static int fake_fail(int error_number)
{
    errno = error_number;
    return -1;
}

static int fake_open(const char *path, int flags)
{
    (void)flags;
    if (strcmp(path, "/dev/camera") != 0)
    {
        return fake_fail(ENOENT);
    }
    ++fake.open_count;
    return FAKE_FD;
}

static int fake_close(int fd)
{
    fake.open_count -= fd == FAKE_FD;
    return 0;
}

static int fake_set_format(struct v4l2_pix_format *pix)
{
    // As vivid does: a size that it has not becomes its first one.
    uint32_t width = fake.sizes[0][0], height = fake.sizes[0][1];
    for (unsigned i = 0; i < fake.size_count; ++i)
    {
        if (pix->width == fake.sizes[i][0] && pix->height == fake.sizes[i][1])
        {
            width = pix->width, height = pix->height;
        }
    }
    // Buffers that were not unmapped keep the driver busy.
    if (fake.mapped_count > 0)
    {
        return fake_fail(EBUSY);
    }
    pix->width = width, pix->height = height;
    pix->bytesperline = 2 * width + fake.padding_bytes;
    return 0;
}

static int fake_set_control(const struct v4l2_control *control)
{
    if (!fake.has_controls)
    {
        return fake_fail(EINVAL);
    }
    if (control->id == V4L2_CID_EXPOSURE_AUTO)
    {
        fake.exposure_is_manual = control->value == V4L2_EXPOSURE_MANUAL;
    }
    if (control->id == V4L2_CID_AUTO_WHITE_BALANCE)
    {
        fake.white_balance_is_locked = control->value == 0;
    }
    return 0;
}

static int fake_dequeue(struct v4l2_buffer *buffer)
{
    if (fake.arrival_count == 0 || fake.fifo_count == 0)
    {
        return fake_fail(EAGAIN);
    }
    const struct fake_arrival arrival = fake.arrivals[0];
    memmove(fake.arrivals, fake.arrivals + 1, --fake.arrival_count * sizeof arrival);
    buffer->index = fake.fifo[0];
    memmove(fake.fifo, fake.fifo + 1, --fake.fifo_count * sizeof fake.fifo[0]);
    fake.queued[buffer->index] = false;
    buffer->sequence = arrival.sequence;
    buffer->flags = arrival.flags;
    buffer->bytesused = arrival.bytes_used;
    buffer->timestamp.tv_sec = arrival.timestamp_us / 1000000;
    buffer->timestamp.tv_usec = arrival.timestamp_us % 1000000;
    return 0;
}

static int fake_enqueue(const struct v4l2_buffer *buffer)
{
    if (buffer->index >= FAKE_BUFFERS || fake.queued[buffer->index])
    {
        return fake_fail(EINVAL);
    }
    fake.queued[buffer->index] = true;
    fake.fifo[fake.fifo_count++] = buffer->index;
    return 0;
}

static int fake_enumerate_size(struct v4l2_frmsizeenum *size)
{
    if (size->index >= fake.size_count)
    {
        return fake_fail(EINVAL);
    }
    size->type = V4L2_FRMSIZE_TYPE_DISCRETE;
    size->discrete.width = fake.sizes[size->index][0];
    size->discrete.height = fake.sizes[size->index][1];
    return 0;
}

static int fake_ioctl(int fd, unsigned long request, void *argument)
{
    if (fd != FAKE_FD)
    {
        return fake_fail(EBADF);
    }
    if (++fake.call_count >= fake.fails_at && fake.fails_at > 0)
    {
        return fake_fail(fake.fails_errno);
    }
    switch (request)
    {
        case VIDIOC_QUERYCAP:
            ((struct v4l2_capability *)argument)->capabilities =
                V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
            return 0;
        case VIDIOC_ENUM_FMT: {
            struct v4l2_fmtdesc *format = argument;
            if (format->index >= fake.format_count)
            {
                return fake_fail(EINVAL);
            }
            format->pixelformat = fake.formats[format->index];
            return 0;
        }
        case VIDIOC_ENUM_FRAMESIZES: return fake_enumerate_size(argument);
        case VIDIOC_S_FMT: return fake_set_format(&((struct v4l2_format *)argument)->fmt.pix);
        case VIDIOC_S_PARM: return 0;
        case VIDIOC_S_CTRL: return fake_set_control(argument);
        case VIDIOC_REQBUFS:
            ((struct v4l2_requestbuffers *)argument)->count =
                ((struct v4l2_requestbuffers *)argument)->count > 0 ? FAKE_BUFFERS : 0;
            return 0;
        case VIDIOC_QUERYBUF:
            ((struct v4l2_buffer *)argument)->length = FAKE_BUFFER_BYTES;
            ((struct v4l2_buffer *)argument)->m.offset = ((struct v4l2_buffer *)argument)->index;
            return 0;
        case VIDIOC_QBUF: return fake_enqueue(argument);
        case VIDIOC_DQBUF: return fake_dequeue(argument);
        case VIDIOC_STREAMON: fake.streaming = true; return 0;
        case VIDIOC_STREAMOFF:
            fake.streaming = false;
            fake.fifo_count = 0;
            memset(fake.queued, 0, sizeof fake.queued);
            return 0;
        default: return fake_fail(ENOTTY);
    }
}

static void *fake_mmap(size_t length, int fd, off_t offset)
{
    if (fd != FAKE_FD || length != FAKE_BUFFER_BYTES || offset >= FAKE_BUFFERS)
    {
        errno = EINVAL;
        return MAP_FAILED;
    }
    ++fake.mapped_count;
    return fake.memory[offset];
}

static int fake_munmap(void *address, size_t length)
{
    (void)address;
    fake.mapped_count -= length == FAKE_BUFFER_BYTES;
    return 0;
}

static const struct hal_sys fake_sys = {
    .open = fake_open,
    .close = fake_close,
    .ioctl = fake_ioctl,
    .mmap = fake_mmap,
    .munmap = fake_munmap,
};

#endif

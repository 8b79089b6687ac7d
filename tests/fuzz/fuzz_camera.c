// SPDX-License-Identifier: Apache-2.0
// A camera driver that answers anything: every frame it gives can be read to its last byte, and
// after closing nothing of it is left.
#include <errno.h>
#include <linux/videodev2.h>
#include <sys/mman.h>

#include "fuzz.h"
#include "fw/step.h"
#include "hal_linux/camera_v4l2.h"
#include "hal_linux/clock_linux.h"

#define TAKES 16
#define MAX_BUFFER_BYTES (1 << 20)

static struct bytes in;
static int open_count, mapped_count;

static int refuse(void)
{
    static const int errors[] = {EINVAL, EAGAIN, ENODEV, EIO, EBUSY, ENOTTY, EINTR, ENOMEM};
    errno = errors[take(&in, 1) % 8];
    return -1;
}

static int fuzz_open(const char *path, int flags)
{
    (void)path;
    (void)flags;
    ++open_count;
    return 3;
}

static int fuzz_close(int fd)
{
    (void)fd;
    --open_count;
    return 0;
}

// What is asked for, with some of its bytes changed.
static void disturb(void *answer, size_t size)
{
    const size_t count = take(&in, 1) % 4;
    for (size_t i = 0; i < count; ++i)
    {
        const size_t at = take(&in, 1) % size;
        ((uint8_t *)answer)[at] = (uint8_t)take(&in, 1);
    }
}

static void fill_buffer(struct v4l2_buffer *buffer)
{
    buffer->index = (uint32_t)take(&in, 1) % 5;
    buffer->bytesused = (uint32_t)take(&in, 3);
    buffer->flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
    buffer->sequence = (uint32_t)take(&in, 1);
    disturb(buffer, sizeof *buffer);
}

static void answer(unsigned long request, void *argument)
{
    switch (request)
    {
        case VIDIOC_QUERYCAP:
            ((struct v4l2_capability *)argument)->capabilities =
                V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
            break;
        case VIDIOC_ENUM_FMT:
            ((struct v4l2_fmtdesc *)argument)->pixelformat =
                take(&in, 1) % 4 == 0 ? V4L2_PIX_FMT_MJPEG : V4L2_PIX_FMT_YUYV;
            break;
        case VIDIOC_ENUM_FRAMESIZES: {
            struct v4l2_frmsizeenum *size = argument;
            size->type = (uint32_t)take(&in, 1) % 4;
            size->discrete.width = (uint32_t)take(&in, 2);
            size->discrete.height = (uint32_t)take(&in, 2);
            break;
        }
        case VIDIOC_S_FMT:
            disturb(&((struct v4l2_format *)argument)->fmt.pix, sizeof(struct v4l2_pix_format));
            break;
        case VIDIOC_REQBUFS: disturb(argument, sizeof(uint32_t)); break;
        case VIDIOC_QUERYBUF:
            ((struct v4l2_buffer *)argument)->length = (uint32_t)take(&in, 3);
            break;
        case VIDIOC_DQBUF: fill_buffer(argument); break;
        default: break;
    }
}

// One call in eight fails; all do when the bytes are over.
static int fuzz_ioctl(int fd, unsigned long request, void *argument)
{
    (void)fd;
    if (in.left == 0 || take(&in, 1) % 8 == 0)
    {
        return refuse();
    }
    answer(request, argument);
    return 0;
}

static void *fuzz_mmap(size_t length, int fd, off_t offset)
{
    (void)fd;
    (void)offset;
    void *block = length > 0 && length <= MAX_BUFFER_BYTES ? calloc(1, length) : NULL;
    mapped_count += block != NULL;
    return block != NULL ? block : MAP_FAILED;
}

static int fuzz_munmap(void *address, size_t length)
{
    (void)length;
    free(address);
    --mapped_count;
    return 0;
}

static void drive(const struct hal_camera *camera, const struct hal_camera_format *format)
{
    static struct fw_ctx ctx;
    struct fw_config config = fw_config_default();
    config.width_px = format->width_px;
    config.height_px = format->height_px;
    CLAIM(fw_init(&ctx, &config) == FW_OK);
    enum fw_err err = FW_OK;
    for (int i = 0; i < TAKES && (err == FW_OK || err == FW_ERR_TIMEOUT); ++i)
    {
        struct fw_frame frame;
        struct fw_output out;
        err = hal_camera_take(camera, &frame);
        fw_step(&ctx, err == FW_OK ? &frame : NULL, i, &out);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const struct hal_sys sys = {.open = fuzz_open,
                                       .close = fuzz_close,
                                       .ioctl = fuzz_ioctl,
                                       .mmap = fuzz_mmap,
                                       .munmap = fuzz_munmap};
    const struct camera_v4l2_config config = {
        .path = "camera", .width_px = 64, .height_px = 48, .rate_Hz = 30};
    const struct hal_clock clock = clock_linux();
    struct camera_v4l2 device;
    const struct hal_camera camera = camera_v4l2_make(&device, &config, &clock, &sys);
    in = (struct bytes){data, size};
    for (int opens = 0; opens < 2; ++opens)
    {
        struct hal_camera_format format;
        if (hal_camera_open(&camera, &format) == FW_OK)
        {
            drive(&camera, &format);
        }
        hal_camera_close(&camera);
        CLAIM(open_count == 0 && mapped_count == 0);
    }
    return 0;
}

// SPDX-License-Identifier: Apache-2.0
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "agent.h"

static int loopback = -1;

int camera_open(const char *device, int width_px, int height_px)
{
    if (loopback >= 0)
    {
        (void)close(loopback);
    }
    loopback = open(device, O_WRONLY | O_CLOEXEC);
    struct v4l2_format format = {.type = V4L2_BUF_TYPE_VIDEO_OUTPUT};
    format.fmt.pix = (struct v4l2_pix_format){
        .width = (uint32_t)width_px,
        .height = (uint32_t)height_px,
        .pixelformat = V4L2_PIX_FMT_YUYV,
        .field = V4L2_FIELD_NONE,
        .bytesperline = 2 * (uint32_t)width_px,
        .sizeimage = 2 * (uint32_t)width_px * (uint32_t)height_px,
        .colorspace = V4L2_COLORSPACE_SRGB,
    };
    return loopback < 0 ? -1 : ioctl(loopback, VIDIOC_S_FMT, &format);
}

long camera_write(const uint8_t *frame, size_t length)
{
    return write(loopback, frame, length);
}

// @return the index of a menu's entry, or the number that the text is.
static int32_t value_of(int fd, const struct v4l2_queryctrl *control, const char *text)
{
    struct v4l2_querymenu entry = {.id = control->id};
    for (int32_t i = control->minimum;
         control->type == V4L2_CTRL_TYPE_MENU && i <= control->maximum; ++i)
    {
        entry.index = (uint32_t)i;
        if (ioctl(fd, VIDIOC_QUERYMENU, &entry) == 0 && strcmp((char *)entry.name, text) == 0)
        {
            return i;
        }
    }
    return (int32_t)strtol(text, NULL, 10);
}

static int set_control(int fd, const char *name, const char *value)
{
    struct v4l2_queryctrl control = {.id = V4L2_CTRL_FLAG_NEXT_CTRL};
    for (; ioctl(fd, VIDIOC_QUERYCTRL, &control) == 0; control.id |= V4L2_CTRL_FLAG_NEXT_CTRL)
    {
        if (strcmp((char *)control.name, name) == 0)
        {
            struct v4l2_control wanted = {control.id, value_of(fd, &control, value)};
            return ioctl(fd, VIDIOC_S_CTRL, &wanted);
        }
    }
    return -1;
}

int camera_control(const char *device, const char *name, const char *value)
{
    const int fd = open(device, O_RDWR | O_CLOEXEC);
    if (fd < 0)
    {
        return -1;
    }
    const int result = set_control(fd, name, value);
    const int error = errno;
    (void)close(fd);
    errno = error;
    return result;
}

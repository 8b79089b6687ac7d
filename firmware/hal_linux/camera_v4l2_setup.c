// SPDX-License-Identifier: Apache-2.0
// What a camera is asked before it streams.
#include <errno.h>
#include <linux/videodev2.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hal_linux/camera_v4l2.h"

static int call(struct camera_v4l2 *camera, unsigned long request, void *argument)
{
    return camera->sys->ioctl(camera->fd, request, argument);
}

static enum fw_err check_capability(struct camera_v4l2 *camera)
{
    struct v4l2_capability capability = {0};
    if (call(camera, VIDIOC_QUERYCAP, &capability) != 0)
    {
        return hal_sys_err(errno);
    }
    const uint32_t has = capability.capabilities & V4L2_CAP_DEVICE_CAPS ? capability.device_caps
                                                                        : capability.capabilities;
    const uint32_t needed = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
    if ((has & needed) != needed)
    {
        hal_sys_note("streams no video: a camera's second node carries no picture: try the other");
        return FW_ERR_FORMAT;
    }
    return FW_OK;
}

// YUYV if the camera has it, which costs nothing to read; else Motion-JPEG.
static enum fw_err choose_format(struct camera_v4l2 *camera)
{
    struct v4l2_fmtdesc format = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
    char offered[96] = "";
    bool has_mjpg = false;
    for (; call(camera, VIDIOC_ENUM_FMT, &format) == 0; ++format.index)
    {
        if (format.pixelformat == V4L2_PIX_FMT_YUYV)
        {
            camera->is_mjpg = false;
            return FW_OK;
        }
        const size_t used = strlen(offered);
        (void)snprintf(offered + used, sizeof offered - used, " %.4s",
                       (const char *)&format.pixelformat);
        has_mjpg |= format.pixelformat == V4L2_PIX_FMT_MJPEG;
    }
    if (errno != EINVAL)
    {
        return hal_sys_err(errno);
    }
    camera->is_mjpg = has_mjpg;
    if (!has_mjpg)
    {
        hal_sys_note("has neither YUYV nor MJPG, but%s: name another camera",
                     offered[0] != '\0' ? offered : " no format at all");
    }
    return has_mjpg ? FW_OK : FW_ERR_FORMAT;
}

static uint32_t pixel_format(const struct camera_v4l2 *camera)
{
    return camera->is_mjpg ? V4L2_PIX_FMT_MJPEG : V4L2_PIX_FMT_YUYV;
}

// Nearest of the camera's own sizes that the core can read; the size asked for if the camera lists
// none or any.
static void choose_size(struct camera_v4l2 *camera, uint32_t *width_px, uint32_t *height_px)
{
    const int wanted_width_px = camera->config.width_px;
    const int wanted_height_px = camera->config.height_px;
    *width_px = (uint32_t)wanted_width_px;
    *height_px = (uint32_t)wanted_height_px;
    int best_distance_px = -1;
    struct v4l2_frmsizeenum size = {.pixel_format = pixel_format(camera)};
    for (; call(camera, VIDIOC_ENUM_FRAMESIZES, &size) == 0; ++size.index)
    {
        if (size.type != V4L2_FRMSIZE_TYPE_DISCRETE)
        {
            return;
        }
        if (size.discrete.width > FW_MAX_WIDTH_PX || size.discrete.height > FW_MAX_HEIGHT_PX)
        {
            continue;
        }
        const int distance_px = abs((int)size.discrete.width - wanted_width_px) +
                                abs((int)size.discrete.height - wanted_height_px);
        if (best_distance_px < 0 || distance_px < best_distance_px)
        {
            best_distance_px = distance_px;
            *width_px = size.discrete.width;
            *height_px = size.discrete.height;
        }
    }
}

static enum fw_err set_format(struct camera_v4l2 *camera)
{
    struct v4l2_format format = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
    struct v4l2_pix_format *pix = &format.fmt.pix;
    choose_size(camera, &pix->width, &pix->height);
    pix->pixelformat = pixel_format(camera);
    pix->field = V4L2_FIELD_NONE;
    if (call(camera, VIDIOC_S_FMT, &format) != 0)
    {
        return hal_sys_err(errno);
    }
    const uint32_t row_bytes = 2 * pix->width;
    const bool has_stride = !camera->is_mjpg && pix->bytesperline != 0;
    const uint32_t stride_bytes = has_stride ? pix->bytesperline : row_bytes;
    if (pix->pixelformat != pixel_format(camera) || pix->width < 2 ||
        pix->width > FW_MAX_WIDTH_PX || pix->width % 2 != 0 || pix->height < 1 ||
        pix->height > FW_MAX_HEIGHT_PX || stride_bytes < row_bytes || stride_bytes > INT32_MAX)
    {
        hal_sys_note("gives %.4s of %u x %u, not %.4s of at most %d x %d",
                     (const char *)&pix->pixelformat, pix->width, pix->height,
                     (const char *)&(uint32_t){pixel_format(camera)}, FW_MAX_WIDTH_PX,
                     FW_MAX_HEIGHT_PX);
        return FW_ERR_FORMAT;
    }
    camera->width_px = (int)pix->width;
    camera->height_px = (int)pix->height;
    camera->stride_bytes = (int)stride_bytes;
    return FW_OK;
}

// Cameras may lack these controls: what they refuse stays as it is.
static void set_control(struct camera_v4l2 *camera, uint32_t id, int32_t value)
{
    struct v4l2_control control = {.id = id, .value = value};
    (void)call(camera, VIDIOC_S_CTRL, &control);
}

static void set_rate(struct camera_v4l2 *camera)
{
    struct v4l2_streamparm parameters = {.type = V4L2_BUF_TYPE_VIDEO_CAPTURE};
    parameters.parm.capture.timeperframe.numerator = 1;
    parameters.parm.capture.timeperframe.denominator = (uint32_t)camera->config.rate_Hz;
    (void)call(camera, VIDIOC_S_PARM, &parameters);
}

static void lock_controls(struct camera_v4l2 *camera)
{
    // Never a slower rate for a longer exposure.
    set_control(camera, V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0);
    if (camera->config.exposure_100us >= 0)
    {
        set_control(camera, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL);
    }
    if (camera->config.exposure_100us > 0)
    {
        set_control(camera, V4L2_CID_EXPOSURE_ABSOLUTE, camera->config.exposure_100us);
    }
    if (camera->config.white_balance_K >= 0)
    {
        set_control(camera, V4L2_CID_AUTO_WHITE_BALANCE, 0);
    }
    if (camera->config.white_balance_K > 0)
    {
        set_control(camera, V4L2_CID_WHITE_BALANCE_TEMPERATURE, camera->config.white_balance_K);
    }
}

enum fw_err camera_v4l2_setup(struct camera_v4l2 *camera)
{
    enum fw_err err = check_capability(camera);
    if (err == FW_OK)
    {
        err = choose_format(camera);
    }
    if (err == FW_OK)
    {
        err = set_format(camera);
    }
    if (err == FW_OK)
    {
        set_rate(camera);
        lock_controls(camera);
    }
    return err;
}

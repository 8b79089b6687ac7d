// SPDX-License-Identifier: Apache-2.0
#include "hal_linux/sys.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

#define HAL_SYS_NOTE_MAX 160

static int kernel_open(const char *path, int flags)
{
    return open(path, flags | O_CLOEXEC);
}

static int kernel_ioctl(int fd, unsigned long request, void *argument)
{
    int result;
    do
    {
        result = ioctl(fd, request, argument);
    } while (result == -1 && errno == EINTR);
    return result;
}

static void *kernel_mmap(size_t length, int fd, off_t offset)
{
    return mmap(NULL, length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, offset);
}

const struct hal_sys hal_sys_kernel = {
    .open = kernel_open,
    .close = close,
    .ioctl = kernel_ioctl,
    .read = read,
    .write = write,
    .mmap = kernel_mmap,
    .munmap = munmap,
};

static _Thread_local int last_error;
static _Thread_local char noted[HAL_SYS_NOTE_MAX];

void hal_sys_note(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(noted, sizeof noted, format, arguments);
    va_end(arguments);
    last_error = 0;
}

int hal_sys_last_error(void)
{
    return last_error;
}

static const char *remedy(int error_number)
{
    switch (error_number)
    {
        case EACCES:
        case EPERM: return ": add this user to the group that `ls -l` shows";
        case EBUSY: return ": another program has it: end that";
        case ENOENT:
        case ENODEV:
        case ENXIO:
        case EREMOTEIO: return ": is it plugged in and switched on?";
        default: return "";
    }
}

const char *hal_sys_reason(void)
{
    if (last_error != 0)
    {
        (void)snprintf(noted, sizeof noted, "%s%s", strerror(last_error), remedy(last_error));
    }
    return noted;
}

enum fw_err hal_sys_err(int error_number)
{
    last_error = error_number;
    switch (error_number)
    {
        case 0: return FW_OK;
        case ENODEV:
        case ENXIO:
        case ENOENT:
        case EREMOTEIO: return FW_ERR_NO_DEVICE;
        case EAGAIN:
        case ETIMEDOUT: return FW_ERR_TIMEOUT;
        case EINVAL:
        case ENOTTY: return FW_ERR_FORMAT;
        default: return FW_ERR_IO;
    }
}

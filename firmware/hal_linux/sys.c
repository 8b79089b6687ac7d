// SPDX-License-Identifier: Apache-2.0
#include "hal_linux/sys.h"

#include <errno.h>
#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

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

enum fw_err hal_sys_err(int error_number)
{
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

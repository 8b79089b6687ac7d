// SPDX-License-Identifier: Apache-2.0
// The calls into the kernel that drivers make, as a table: a test gives its own.
#ifndef HAL_LINUX_SYS_H
#define HAL_LINUX_SYS_H

#include <stddef.h>
#include <sys/types.h>

#include "fw/err.h"

// As the functions of the same names: -1 (MAP_FAILED) and errno on failure.
struct hal_sys
{
    int (*open)(const char *path, int flags);
    int (*close)(int fd);
    int (*ioctl)(int fd, unsigned long request, void *argument);
    ssize_t (*read)(int fd, void *bytes, size_t count);
    ssize_t (*write)(int fd, const void *bytes, size_t count);
    void *(*mmap)(size_t length, int fd, off_t offset);
    int (*munmap)(void *address, size_t length);
};

// The kernel's own.
extern const struct hal_sys hal_sys_kernel;

// Translates errno, and remembers it for this thread.
enum fw_err hal_sys_err(int error_number);

// A failure that is none of the system's calls: the words are remembered instead.
void hal_sys_note(const char *format, ...) __attribute__((format(printf, 1, 2)));

// The errno of the last failure in this thread; 0: none, or one that was noted in words.
int hal_sys_last_error(void);

// The last failure in this thread in words, and what to do about it.
const char *hal_sys_reason(void);

#endif

// SPDX-License-Identifier: Apache-2.0
// Preloaded into the robot's program: makes calls into the kernel fail, for as long as
// /var/failcalls/which says so. That file holds a line for each: function, ioctl number (0: any),
// how the device's path begins (munmap, which has none: -), errno, and the pid that is meant (0:
// all), as in "ioctl 3227014673 /dev/video 5 0". The folder is everybody's, and none that a service
// has its own of, as of /tmp.
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define CONTROL "/var/failcalls/which"
#define FIRST "/var/failcalls/first"

// The call itself, past the functions below.
static size_t read_raw(const char *path, char *text, size_t size)
{
    const long fd = syscall(SYS_openat, AT_FDCWD, path, O_RDONLY | O_CLOEXEC);
    const long got = fd < 0 ? -1 : syscall(SYS_read, fd, text, size - 1);
    (void)syscall(SYS_close, fd);
    text[got > 0 ? got : 0] = '\0';
    return got > 0 ? (size_t)got : 0;
}

// The first failure's time, in ns, for who measures from it.
static void note_time(void)
{
    char text[32];
    struct timespec now;
    const long fd =
        syscall(SYS_openat, AT_FDCWD, FIRST, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    const int length = snprintf(text, sizeof text, "%lld", now.tv_sec * 1000000000LL + now.tv_nsec);
    if (fd >= 0)
    {
        (void)!syscall(SYS_write, fd, text, length);
        (void)syscall(SYS_close, fd);
    }
}

static bool names(const char *line, const char *function, unsigned long request, const char *path,
                  int *error)
{
    char wanted[16], prefix[64];
    unsigned long number;
    int pid;
    return sscanf(line, "%15s %lu %63s %d %d", wanted, &number, prefix, error, &pid) == 5 &&
           strcmp(function, wanted) == 0 && (number == 0 || number == request) &&
           strncmp(path, prefix, strlen(prefix)) == 0 && (pid == 0 || pid == (int)getpid());
}

// @return true, and errno, if this call is to fail.
static bool fails(const char *function, unsigned long request, const char *path)
{
    char text[512];
    int error = 0;
    const int kept = errno;
    bool is_meant = false;
    (void)read_raw(CONTROL, text, sizeof text);
    for (const char *line = text; line != NULL && !is_meant; line = strchr(line, '\n'))
    {
        line += *line == '\n';
        is_meant = names(line, function, request, path, &error);
    }
    if (is_meant)
    {
        note_time();
    }
    errno = is_meant ? error : kept;
    return is_meant;
}

static bool fails_at(const char *function, unsigned long request, int fd)
{
    char link[64], path[128];
    (void)snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    const ssize_t length = readlink(link, path, sizeof path - 1);
    path[length > 0 ? length : 0] = '\0';
    return fails(function, request, path);
}

int ioctl(int fd, unsigned long request, ...)
{
    va_list arguments;
    va_start(arguments, request);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    return fails_at("ioctl", request, fd) ? -1 : (int)syscall(SYS_ioctl, fd, request, argument);
}

ssize_t read(int fd, void *bytes, size_t count)
{
    return fails_at("read", 0, fd) ? -1 : syscall(SYS_read, fd, bytes, count);
}

ssize_t write(int fd, const void *bytes, size_t count)
{
    return fails_at("write", 0, fd) ? -1 : syscall(SYS_write, fd, bytes, count);
}

// What read() and open() become where the compiler checks their arguments.
ssize_t __read_chk(int fd, void *bytes, size_t count, size_t size);
int __open_2(const char *path, int flags);

ssize_t __read_chk(int fd, void *bytes, size_t count, size_t size)
{
    return read(fd, bytes, count < size ? count : size);
}

int open(const char *path, int flags, ...)
{
    va_list arguments;
    va_start(arguments, flags);
    const int mode = va_arg(arguments, int);
    va_end(arguments);
    return fails("open", 0, path) ? -1 : (int)syscall(SYS_openat, AT_FDCWD, path, flags, mode);
}

int __open_2(const char *path, int flags)
{
    return open(path, flags, 0);
}

// Nothing is open after a close that failed, as in Linux.
int close(int fd)
{
    const bool failed = fails_at("close", 0, fd);
    const int error = errno;
    const int result = (int)syscall(SYS_close, fd);
    errno = failed ? error : errno;
    return failed ? -1 : result;
}

int munmap(void *address, size_t length)
{
    return fails("munmap", 0, "-") ? -1 : (int)syscall(SYS_munmap, address, length);
}

void *mmap(void *address, size_t length, int protection, int flags, int fd, off_t offset)
{
    void *(*const next)(void *, size_t, int, int, int, off_t) =
        (void *(*)(void *, size_t, int, int, int, off_t))dlsym(RTLD_NEXT, "mmap");
    return fd >= 0 && fails_at("mmap", 0, fd)
               ? MAP_FAILED
               : next(address, length, protection, flags, fd, offset);
}

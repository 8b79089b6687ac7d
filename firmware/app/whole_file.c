// SPDX-License-Identifier: Apache-2.0
#include "whole_file.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <string.h>
#include <unistd.h>

#include "say.h"

// Once, until it works again. @param path of a file that cannot be opened.
static void tell_failure(struct whole_file *file, const char *path)
{
    if (!file->is_failing)
    {
        say("%s: %s%s%s: rows are lost from here on", file->name, path, path[0] != '\0' ? ": " : "",
            strerror(errno));
    }
    file->is_failing = true;
}

bool whole_file_open(struct whole_file *file, const char *name, const char *path, bool anew)
{
    // Of a pipe: it waits neither for a reader nor for room.
    const int flags = O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NONBLOCK | (anew ? O_TRUNC : 0);
    file->name = name;
    file->fd = open(path, flags, 0644);
    if (file->fd < 0)
    {
        tell_failure(file, path);
    }
    return file->fd >= 0;
}

// The whole piece or nothing of it. @return false and errno on failure.
static bool add_whole(int fd, const void *bytes, size_t length)
{
    const off_t end = lseek(fd, 0, SEEK_END);
    const ssize_t done = write(fd, bytes, length);
    if (done == (ssize_t)length)
    {
        return true;
    }
    const int error = done < 0 ? errno : ENOSPC;
    if (done > 0 && end >= 0)
    {
        (void)!ftruncate(fd, end);
    }
    errno = error;
    return false;
}

bool whole_file_add(struct whole_file *file, const void *bytes, size_t length)
{
    const bool taken = file->fd >= 0 && add_whole(file->fd, bytes, length);
    if (!taken)
    {
        ++file->lost_count;
        tell_failure(file, "");
    }
    else if (file->is_failing)
    {
        say("%s: works again; %" PRIu32 " rows are lost", file->name, file->lost_count);
        file->is_failing = false;
    }
    return taken;
}

void whole_file_close(struct whole_file *file)
{
    if (file->fd >= 0)
    {
        (void)close(file->fd);
        file->fd = -1;
    }
}

// SPDX-License-Identifier: Apache-2.0
// A file that grows by whole pieces, such as rows: one that does not fit, as on a full disk, is
// taken back, counted and told.
#ifndef APP_WHOLE_FILE_H
#define APP_WHOLE_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct whole_file
{
    // What messages call it.
    const char *name;
    // -1: not open.
    int fd;
    uint32_t lost_count;
    // The newest piece was lost.
    bool is_failing;
};

// Goes on in a file that is there, or begins one; what was lost before stays counted.
// @param anew what is there is dropped. @return false on failure, which is told once.
bool whole_file_open(struct whole_file *file, const char *name, const char *path, bool anew);

// Adds one piece, or counts it as lost, as where the file is not open. @return false if it is lost.
bool whole_file_add(struct whole_file *file, const void *bytes, size_t length);
void whole_file_close(struct whole_file *file);

#endif

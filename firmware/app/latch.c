// SPDX-License-Identifier: Apache-2.0
#include "latch.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "say.h"

#define RETRY_US 1000000

struct path
{
    char text[CONFIG_TEXT_MAX + 16];
};

static struct path path_of(const struct latch *latch, bool is_stopped)
{
    struct path path;
    (void)snprintf(path.text, sizeof path.text, "%s/%s", latch->folder,
                   is_stopped ? "stopped" : "not_stopped");
    return path;
}

// @return false and errno on failure.
static bool write_down(const struct latch *latch, bool is_stopped)
{
    const struct path from = path_of(latch, !is_stopped), to = path_of(latch, is_stopped);
    if (rename(from.text, to.text) == 0)
    {
        return true;
    }
    // To read: a stop that is there already is enough, though nothing can be written. That there is
    // none holds only where one could be.
    const int fd = open(to.text, O_RDONLY | O_CREAT | O_CLOEXEC, 0644);
    if (fd >= 0)
    {
        (void)close(fd);
    }
    return fd >= 0 && (is_stopped || access(latch->folder, W_OK) == 0);
}

bool latch_open(struct latch *latch, const char *folder, int64_t now_us)
{
    *latch = (struct latch){.folder = folder};
    latch->is_stopped = folder[0] != '\0' && access(path_of(latch, true).text, F_OK) == 0;
    // Before anything drives it is known whether a stop could be kept.
    const bool is_stopped = latch->is_stopped;
    latch->is_stopped = !is_stopped;
    latch_keep(latch, is_stopped, now_us);
    return is_stopped;
}

void latch_keep(struct latch *latch, bool is_stopped, int64_t now_us)
{
    const bool is_due = latch->is_lost && now_us >= latch->retry_us;
    if (latch->folder[0] == '\0' || (is_stopped == latch->is_stopped && !is_due))
    {
        return;
    }
    const bool was_lost = latch->is_lost;
    latch->is_lost = !write_down(latch, is_stopped);
    latch->is_stopped = is_stopped;
    latch->retry_us = now_us + RETRY_US;
    if (latch->is_lost && !was_lost)
    {
        say("run_dir: %s: %s: whether it was stopped cannot be kept in mind: no autostart",
            latch->folder, strerror(errno));
    }
}

bool latch_works(const struct latch *latch)
{
    return latch->folder[0] != '\0' && !latch->is_lost;
}

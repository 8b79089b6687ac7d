// SPDX-License-Identifier: Apache-2.0
#include "stopper.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

// @return false if the configuration leaves open which board it is, and none answers.
static bool make(struct stopper *stopper)
{
    char error[CONFIG_ERROR_MAX];
    stopper->is_made =
        stopper->is_made || devices_make_board(stopper->config, stopper->dry_run, &stopper->drivers,
                                               &stopper->devices, error);
    return stopper->is_made;
}

void stopper_hold(struct stopper *stopper)
{
    if (make(stopper))
    {
        // Else the stop tries again.
        (void)hal_motors_open(&stopper->devices.motors);
    }
}

bool stopper_stop(struct stopper *stopper)
{
    const bool made = make(stopper);
    // Asked even if the stop was refused: of a board that is only heard, the line has to be read.
    const enum fw_err told = made ? hal_motors_stop(&stopper->devices.motors) : FW_ERR_NO_DEVICE;
    const enum fw_err confirmed =
        made ? hal_motors_confirm(&stopper->devices.motors) : FW_ERR_NO_DEVICE;
    stopper->was_told = told == FW_OK;
    return told == FW_OK && confirmed == FW_OK;
}

// Dead, though its parent may not have taken notice. Who cannot be looked at, as where no more
// files can be opened, may live.
static bool is_gone(pid_t pid)
{
    if (pid <= 0 || (kill(pid, 0) != 0 && errno == ESRCH))
    {
        return true;
    }
    char path[64], line[256] = "";
    (void)snprintf(path, sizeof path, "/proc/%d/stat", (int)pid);
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
    {
        return errno == ENOENT || errno == ESRCH;
    }
    (void)!read(fd, line, sizeof line - 1);
    (void)close(fd);
    const char *name_end = strrchr(line, ')');
    return name_end == NULL || strchr("ZX", name_end[2]) != NULL;
}

bool stopper_end_driver(struct stopper *stopper, struct watch *watch)
{
    const pid_t driver = watch->driver_pid;
    if (driver > 0)
    {
        (void)kill(driver, SIGKILL);
    }
    const bool gone = is_gone(driver);
    const bool stopped = stopper_stop(stopper);
    if (gone && stopped)
    {
        watch->driver_pid = 0;
        watch->may_move = false;
    }
    return gone && stopped;
}

void stopper_close(struct stopper *stopper)
{
    if (stopper->is_made)
    {
        hal_motors_close(&stopper->devices.motors);
        stopper->is_made = false;
    }
}

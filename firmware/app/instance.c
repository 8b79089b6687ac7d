// SPDX-License-Identifier: Apache-2.0
#include "instance.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

// Nobody answers who asks: each takes a place for as long as the board is held.
#define ASKERS_MAX 4096

// Words of the command lines of programs that drive a TurboPi: the vendor's, GMU-ASRC's, and the
// ROS packages.
static const char vendor_words[][sizeof "ros_robot_controller"] = {
    "TurboPi.py", "hw_button_scan", "HiwonderSDK",          "buttonman",
    "hiwonder",   "RPCServer.py",   "ros_robot_controller", "turbopi_ros"};

// The abstract address of a board: it goes away with the last process that has it, however that
// ends.
static socklen_t address_of(const char *path, struct sockaddr_un *address)
{
    char resolved[PATH_MAX];
    const char *name = realpath(path, resolved) != NULL ? resolved : path;
    *address = (struct sockaddr_un){.sun_family = AF_UNIX};
    const int length =
        snprintf(address->sun_path + 1, sizeof address->sun_path - 1, "turbopi:%s", name);
    const size_t room = sizeof address->sun_path - 2;
    return (socklen_t)(offsetof(struct sockaddr_un, sun_path) + 1 +
                       ((size_t)length < room ? (size_t)length : room));
}

pid_t instance_holder(const char *path)
{
    struct sockaddr_un address;
    const socklen_t length = address_of(path, &address);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    struct ucred who = {0};
    socklen_t who_length = sizeof who;
    pid_t holder = fd < 0 ? -1 : 0;
    if (fd >= 0 && connect(fd, (const struct sockaddr *)&address, length) == 0)
    {
        holder = getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &who, &who_length) == 0 ? who.pid : -1;
    }
    else if (fd >= 0 && errno != ECONNREFUSED)
    {
        holder = -1;
    }
    if (fd >= 0)
    {
        (void)close(fd);
    }
    return holder;
}

int instance_take(const char *path, pid_t *holder)
{
    struct sockaddr_un address;
    const socklen_t length = address_of(path, &address);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const bool taken = fd >= 0 && bind(fd, (const struct sockaddr *)&address, length) == 0 &&
                       listen(fd, ASKERS_MAX) == 0;
    *holder = taken ? 0 : instance_holder(path);
    if (!taken && fd >= 0)
    {
        (void)close(fd);
    }
    return taken ? fd : -1;
}

// Reads the beginning of a small file of /proc. @return bytes read.
static size_t read_proc(pid_t pid, const char *name, char *text, size_t size)
{
    char path[64];
    (void)snprintf(path, sizeof path, "/proc/%d/%s", (int)pid, name);
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    const ssize_t got = fd < 0 ? 0 : read(fd, text, size - 1);
    if (fd >= 0)
    {
        (void)close(fd);
    }
    const size_t length = got > 0 ? (size_t)got : 0;
    text[length] = '\0';
    return length;
}

void instance_describe(pid_t pid, char who[INSTANCE_WHO_MAX])
{
    char name[32], cgroup[512];
    (void)read_proc(pid, "comm", name, sizeof name);
    (void)read_proc(pid, "cgroup", cgroup, sizeof cgroup);
    name[strcspn(name, "\n")] = '\0';
    cgroup[strcspn(cgroup, "\n")] = '\0';
    const char *unit = strrchr(cgroup, '/');
    const bool is_service = unit != NULL && strstr(unit, ".service") != NULL;
    if (name[0] == '\0')
    {
        (void)snprintf(who, INSTANCE_WHO_MAX, "what process %d left behind (wheelguard?)",
                       (int)pid);
        return;
    }
    (void)snprintf(who, INSTANCE_WHO_MAX, "%s (pid %d%s%.80s)", name, (int)pid,
                   is_service ? ", " : "", is_service ? unit + 1 : "");
}

static bool has_open(pid_t pid, const char *path)
{
    char folder[64], link[PATH_MAX], target[PATH_MAX];
    (void)snprintf(folder, sizeof folder, "/proc/%d/fd", (int)pid);
    DIR *fds = opendir(folder);
    bool found = false;
    for (struct dirent *entry; fds != NULL && !found && (entry = readdir(fds)) != NULL;)
    {
        (void)snprintf(link, sizeof link, "%s/%s", folder, entry->d_name);
        const ssize_t length = readlink(link, target, sizeof target - 1);
        target[length > 0 ? length : 0] = '\0';
        found = strcmp(target, path) == 0;
    }
    if (fds != NULL)
    {
        (void)closedir(fds);
    }
    return found;
}

static bool runs_vendor_program(pid_t pid, const char *unused)
{
    (void)unused;
    char line[1024];
    const size_t length = read_proc(pid, "cmdline", line, sizeof line);
    for (size_t i = 0; i < length; ++i)
    {
        line[i] = line[i] == '\0' ? ' ' : line[i];
    }
    for (size_t i = 0; i < sizeof vendor_words / sizeof vendor_words[0]; ++i)
    {
        if (strstr(line, vendor_words[i]) != NULL)
        {
            return true;
        }
    }
    return false;
}

// Describes the first other process of which it is true.
static bool find_process(bool (*is_it)(pid_t pid, const char *path), const char *path,
                         char who[INSTANCE_WHO_MAX])
{
    DIR *processes = opendir("/proc");
    bool found = false;
    for (struct dirent *entry; processes != NULL && !found && (entry = readdir(processes)) != NULL;)
    {
        const pid_t pid = isdigit((unsigned char)entry->d_name[0]) ? atoi(entry->d_name) : 0;
        found = pid > 0 && pid != getpid() && is_it(pid, path);
        if (found)
        {
            instance_describe(pid, who);
        }
    }
    if (processes != NULL)
    {
        (void)closedir(processes);
    }
    return found;
}

bool instance_user_of(const char *path, char who[INSTANCE_WHO_MAX])
{
    char resolved[PATH_MAX];
    return find_process(has_open, realpath(path, resolved) != NULL ? resolved : path, who);
}

bool instance_vendor(char who[INSTANCE_WHO_MAX])
{
    return find_process(runs_vendor_program, NULL, who);
}

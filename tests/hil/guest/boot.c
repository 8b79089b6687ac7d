// SPDX-License-Identifier: Apache-2.0
// What an init does, as far as the robot's program needs it.
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <net/if.h>
#include <net/route.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "agent.h"

static void mount_at(const char *type, const char *path)
{
    (void)mkdir(path, 0755);
    if (mount(type, path, type, 0, NULL) != 0 && errno != EBUSY)
    {
        complain(path);
    }
}

void boot_mount(void)
{
    mount_at("devtmpfs", "/dev");
    mount_at("proc", "/proc");
    mount_at("sysfs", "/sys");
    const int console = open("/dev/console", O_RDWR);
    for (int fd = 0; console >= 0 && fd < 3; ++fd)
    {
        (void)dup2(console, fd);
    }
}

int load_module(const char *path, const char *parameters)
{
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    const long result = fd < 0 ? -1 : syscall(SYS_finit_module, fd, parameters, 0);
    const int error = errno;
    (void)close(fd);
    errno = error;
    return (int)result;
}

// Lines of /modules/order: file, a space, parameters.
void boot_load_modules(void)
{
    char line[256], path[300];
    FILE *order = fopen("/modules/order", "r");
    while (order != NULL && fgets(line, sizeof line, order) != NULL)
    {
        line[strcspn(line, "\n")] = '\0';
        char *parameters = strchr(line, ' ');
        if (parameters != NULL)
        {
            *parameters++ = '\0';
        }
        (void)snprintf(path, sizeof path, "/modules/%s", line);
        if (load_module(path, parameters != NULL ? parameters : "") != 0 && errno != EEXIST)
        {
            complain(path);
        }
    }
    if (order != NULL)
    {
        (void)fclose(order);
    }
}

static struct sockaddr address_of(const char *text)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = inet_addr(text)};
    struct sockaddr generic;
    memcpy(&generic, &address, sizeof generic);
    return generic;
}

void boot_join_multicast_to_lo(void)
{
    char name[] = "lo";
    struct ifreq lo = {.ifr_name = "lo", .ifr_flags = IFF_UP | IFF_RUNNING};
    struct rtentry route = {.rt_dst = address_of("224.0.0.0"),
                            .rt_genmask = address_of("240.0.0.0"),
                            .rt_flags = RTF_UP,
                            .rt_dev = name};
    const int fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (ioctl(fd, SIOCSIFFLAGS, &lo) != 0 || (ioctl(fd, SIOCADDRT, &route) != 0 && errno != EEXIST))
    {
        complain("lo");
    }
    (void)close(fd);
}

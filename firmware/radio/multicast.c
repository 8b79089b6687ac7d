// SPDX-License-Identifier: Apache-2.0
#include "radio/multicast.h"

#include <arpa/inet.h>
#include <errno.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define DEFAULT_ADDRESS "239.255.76.67"
#define DEFAULT_PORT 7667
#define NEWS_BYTES 8192

bool multicast_parse(const char *url, struct in_addr *group, uint16_t *port)
{
    static const char scheme[] = "udpm://";
    if (strncmp(url, scheme, sizeof scheme - 1) != 0)
    {
        return false;
    }
    const char *rest = url + sizeof scheme - 1;
    char text[INET_ADDRSTRLEN] = DEFAULT_ADDRESS;
    const size_t length = strcspn(rest, ":?");
    if (length >= sizeof text)
    {
        return false;
    }
    if (length > 0)
    {
        memcpy(text, rest, length);
        text[length] = '\0';
    }
    long number = DEFAULT_PORT;
    if (rest[length] == ':')
    {
        char *end;
        number = strtol(rest + length + 1, &end, 10);
        if (end == rest + length + 1 || (*end != '\0' && *end != '?'))
        {
            return false;
        }
    }
    *port = (uint16_t)number;
    return number > 0 && number <= UINT16_MAX && inet_pton(AF_INET, text, group) == 1 &&
           IN_MULTICAST(ntohl(group->s_addr));
}

static bool change_membership(const struct multicast *ear, int what, int index)
{
    const struct ip_mreqn request = {.imr_multiaddr = ear->group, .imr_ifindex = index};
    return setsockopt(ear->fd, IPPROTO_IP, what, &request, sizeof request) == 0 ||
           errno == EADDRINUSE;
}

static struct multicast_network *find(struct multicast *ear, int index)
{
    for (size_t i = 0; i < ear->network_count; ++i)
    {
        if (ear->networks[i].index == index)
        {
            return &ear->networks[i];
        }
    }
    return NULL;
}

static void leave(struct multicast *ear, int index)
{
    struct multicast_network *network = find(ear, index);
    // The kernel forgets the network, but not that this socket was a member there.
    (void)change_membership(ear, IP_DROP_MEMBERSHIP, index);
    if (network != NULL)
    {
        *network = ear->networks[--ear->network_count];
    }
}

// A switch or an access point may have forgotten a member that was away: it is told again.
static void join(struct multicast *ear, int index, bool running)
{
    struct multicast_network *network = find(ear, index);
    if (network != NULL && running && !network->running)
    {
        (void)change_membership(ear, IP_DROP_MEMBERSHIP, index);
    }
    if (!change_membership(ear, IP_ADD_MEMBERSHIP, index))
    {
        return;
    }
    if (network == NULL && ear->network_count < MULTICAST_NETWORKS_MAX)
    {
        network = &ear->networks[ear->network_count++];
    }
    if (network != NULL)
    {
        *network = (struct multicast_network){index, running};
    }
}

static void take_news(struct multicast *ear, const struct nlmsghdr *news)
{
    if (news->nlmsg_len < NLMSG_LENGTH(sizeof(struct ifinfomsg)))
    {
        return;
    }
    const struct ifinfomsg *about = NLMSG_DATA(news);
    if (news->nlmsg_type == RTM_DELLINK)
    {
        leave(ear, about->ifi_index);
    }
    else if (news->nlmsg_type == RTM_NEWLINK)
    {
        join(ear, about->ifi_index, (about->ifi_flags & IFF_RUNNING) != 0);
    }
}

void multicast_ask(struct multicast *ear)
{
    const struct
    {
        struct nlmsghdr header;
        struct ifinfomsg about;
    } question = {
        .header = {.nlmsg_len = NLMSG_LENGTH(sizeof(struct ifinfomsg)),
                   .nlmsg_type = RTM_GETLINK,
                   .nlmsg_flags = NLM_F_REQUEST | NLM_F_DUMP},
        .about = {.ifi_family = AF_UNSPEC},
    };
    (void)send(ear->news_fd, &question, sizeof question, MSG_DONTWAIT);
}

void multicast_renew(struct multicast *ear)
{
    _Alignas(struct nlmsghdr) char bytes[NEWS_BYTES];
    for (;;)
    {
        const ssize_t got = recv(ear->news_fd, bytes, sizeof bytes, MSG_DONTWAIT);
        if (got < 0 && errno == ENOBUFS)
        {
            // Something was lost: everything is asked for.
            multicast_ask(ear);
            continue;
        }
        if (got <= 0)
        {
            return;
        }
        size_t left = (size_t)got;
        const struct nlmsghdr *news = (const struct nlmsghdr *)bytes;
        for (; NLMSG_OK(news, left); news = NLMSG_NEXT(news, left))
        {
            take_news(ear, news);
        }
    }
}

static int open_news(void)
{
    const struct sockaddr_nl address = {.nl_family = AF_NETLINK, .nl_groups = RTMGRP_LINK};
    const int fd = socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, NETLINK_ROUTE);
    if (fd >= 0 && bind(fd, (const struct sockaddr *)&address, sizeof address) != 0)
    {
        (void)close(fd);
        return -1;
    }
    return fd;
}

static int open_ear(uint16_t port)
{
    const struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(port)};
    const int yes = 1;
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    // Others on this machine hear the same bus.
    if (fd >= 0 && (setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) != 0 ||
                    bind(fd, (const struct sockaddr *)&address, sizeof address) != 0))
    {
        (void)close(fd);
        return -1;
    }
    return fd;
}

bool multicast_open(struct multicast *ear, struct in_addr group, uint16_t port)
{
    *ear = (struct multicast){.group = group, .port = port, .fd = -1, .news_fd = -1};
    ear->fd = open_ear(port);
    ear->news_fd = ear->fd >= 0 ? open_news() : -1;
    if (ear->news_fd < 0)
    {
        multicast_close(ear);
        return false;
    }
    multicast_ask(ear);
    multicast_renew(ear);
    return true;
}

ssize_t multicast_take(const struct multicast *ear, uint8_t *bytes, size_t size)
{
    return recv(ear->fd, bytes, size, MSG_DONTWAIT);
}

void multicast_close(struct multicast *ear)
{
    const int error = errno;
    if (ear->fd >= 0)
    {
        (void)close(ear->fd);
    }
    if (ear->news_fd >= 0)
    {
        (void)close(ear->news_fd);
    }
    ear->fd = ear->news_fd = -1;
    errno = error;
}

// SPDX-License-Identifier: Apache-2.0
// An ear on a multicast bus that hears on every network of this machine, now and later: when a
// network comes, is made anew or gets its signal back, the group is joined there again. Messages to
// this machine alone are heard, too.
#ifndef RADIO_MULTICAST_H
#define RADIO_MULTICAST_H

#include <netinet/in.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#ifdef __cplusplus
extern "C" {
#endif

#define MULTICAST_NETWORKS_MAX 32
#define MULTICAST_DATAGRAM_MAX 65536

// A network as the kernel numbers it.
struct multicast_network
{
    int index;
    // There is a carrier.
    bool running;
};

struct multicast
{
    struct in_addr group;
    uint16_t port;
    // Messages; news of networks.
    int fd, news_fd;
    struct multicast_network networks[MULTICAST_NETWORKS_MAX];
    size_t network_count;
};

// @param url of LCM's form, udpm://ADDRESS:PORT?...; either part may be missing.
// @return false if it is none of an address for multicast.
bool multicast_parse(const char *url, struct in_addr *group, uint16_t *port);

// Begins to hear; a network need not be there. @return false and errno on failure.
bool multicast_open(struct multicast *ear, struct in_addr group, uint16_t port);

// To be called when news_fd is readable, and now and then besides: news may be lost.
void multicast_renew(struct multicast *ear);

// Asks the kernel to tell of all networks again.
void multicast_ask(struct multicast *ear);

// @return bytes of the next datagram, or -1 if none waits.
ssize_t multicast_take(const struct multicast *ear, uint8_t *bytes, size_t size);

void multicast_close(struct multicast *ear);

#ifdef __cplusplus
}
#endif

#endif

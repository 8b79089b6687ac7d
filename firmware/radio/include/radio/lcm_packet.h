// SPDX-License-Identifier: Apache-2.0
// One datagram of LCM's bus, whatever is in it: liblcm's own receiver, which does not check all
// of it, is not used. Messages in several fragments are none of ours, and are dropped.
#ifndef RADIO_LCM_PACKET_H
#define RADIO_LCM_PACKET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

// The longest name of a channel, without its final 0.
#define LCM_PACKET_CHANNEL_MAX 63

struct lcm_packet
{
    // Inside the datagram.
    const char *channel;
    const uint8_t *data;
    size_t size;
};

// @return false if it is no whole message; then packet is untouched.
bool lcm_packet_read(const uint8_t *datagram, size_t size, struct lcm_packet *packet);

#ifdef __cplusplus
}
#endif

#endif

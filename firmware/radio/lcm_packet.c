// SPDX-License-Identifier: Apache-2.0
#include "radio/lcm_packet.h"

#include <string.h>

// Magic number and the sender's count of messages.
#define HEADER_BYTES 8

static const uint8_t magic[] = {'L', 'C', '0', '2'};

bool lcm_packet_read(const uint8_t *datagram, size_t size, struct lcm_packet *packet)
{
    if (size <= HEADER_BYTES || memcmp(datagram, magic, sizeof magic) != 0)
    {
        return false;
    }
    const uint8_t *channel = datagram + HEADER_BYTES;
    const size_t left = size - HEADER_BYTES;
    const size_t longest = LCM_PACKET_CHANNEL_MAX + 1;
    const uint8_t *end = memchr(channel, '\0', left < longest ? left : longest);
    if (end == NULL)
    {
        return false;
    }
    *packet = (struct lcm_packet){
        .channel = (const char *)channel,
        .data = end + 1,
        .size = (size_t)(datagram + size - (end + 1)),
    };
    return true;
}

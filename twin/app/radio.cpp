// SPDX-License-Identifier: Apache-2.0
#include "radio.h"

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "radio/lcm_packet.h"

namespace twin
{

Radio::Radio(const std::string &url, const std::string &channel_prefix, std::vector<seal_key> keys)
    : plain_(channel_prefix + WIRE_COMMAND_CHANNEL),
      signed_(channel_prefix + WIRE_SIGNED_CHANNEL),
      keys_(std::move(keys)),
      datagram_(MULTICAST_DATAGRAM_MAX)
{
    in_addr group{};
    uint16_t port = 0;
    hears_ = multicast_parse(url.c_str(), &group, &port);
    if (hears_ && !multicast_open(&ear_, group, port))
        throw std::runtime_error("commands cannot be heard on " + url + ": " +
                                 std::strerror(errno));
}

Radio::~Radio()
{
    if (hears_)
        multicast_close(&ear_);
}

bool Radio::Read(const uint8_t *datagram, size_t size, wire_command &command) const
{
    lcm_packet packet{};
    int32_t robot = 0;
    if (!lcm_packet_read(datagram, size, &packet))
        return false;
    if (packet.channel == plain_)
        return wire_read_command(packet.data, packet.size, &command);
    return packet.channel == signed_ && wire_peek_robot(packet.data, packet.size, &robot) &&
           robot >= 0 && static_cast<size_t>(robot) < keys_.size() &&
           wire_read_signed(packet.data, packet.size, &keys_[static_cast<size_t>(robot)], &command);
}

void Radio::Hear(const std::function<void(const wire_command &)> &take)
{
    if (!hears_)
        return;
    multicast_renew(&ear_);
    wire_command command;
    for (ssize_t got; (got = multicast_take(&ear_, datagram_.data(), datagram_.size())) >= 0;)
        if (Read(datagram_.data(), static_cast<size_t>(got), command))
            take(command);
}

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
// Hears the operator on LCM's bus as the robot's program does: any packet may come.
#ifndef APP_RADIO_H
#define APP_RADIO_H

#include <functional>
#include <string>
#include <vector>

#include "radio/multicast.h"
#include "radio/wire.h"

namespace twin
{

class Radio
{
public:
    // `url`: of the bus; one that is not udpm:// is not heard. `keys`: of the robots by number.
    // Throws std::runtime_error in one sentence.
    Radio(const std::string &url, const std::string &channel_prefix, std::vector<seal_key> keys);
    ~Radio();
    Radio(const Radio &) = delete;
    Radio &operator=(const Radio &) = delete;

    // Gives all commands that wait to `take`.
    void Hear(const std::function<void(const wire_command &)> &take);

private:
    bool Read(const uint8_t *datagram, size_t size, wire_command &command) const;

    multicast ear_{};
    bool hears_;
    std::string plain_, signed_;  // channels
    std::vector<seal_key> keys_;
    std::vector<uint8_t> datagram_;
};

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// Where messages go: an LCM bus, a log file, or both.
#ifndef APP_OUTLET_H
#define APP_OUTLET_H

#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <string>
#include <vector>

#include "log_writer.h"

namespace twin
{

class Outlet
{
public:
    // Opens a bus; an empty `url` is LCM's default on this machine alone. Throws std::runtime_error
    // in one sentence if messages cannot be sent there.
    void OpenBus(const std::string &url);
    // As LogWriter's constructor.
    void OpenLog(const std::string &path) { log_ = std::make_unique<LogWriter>(path); }
    void Finish();
    // nullptr if there is none.
    lcm::LCM *Bus() { return bus_.get(); }

    // `utime_us` is when the message is received: the log's time stamp.
    template <class Message>
    void Send(int64_t utime_us, const std::string &channel, const Message &message)
    {
        bytes_.resize(static_cast<size_t>(message.getEncodedSize()));
        message.encode(bytes_.data(), 0, static_cast<int>(bytes_.size()));
        SendBytes(utime_us, channel);
    }

private:
    void SendBytes(int64_t utime_us, const std::string &channel);

    std::unique_ptr<lcm::LCM> bus_;
    std::unique_ptr<LogWriter> log_;
    std::vector<uint8_t> bytes_;
};

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// Where messages go: an LCM bus, a log file, or both.
#ifndef APP_OUTLET_H
#define APP_OUTLET_H

#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <string>
#include <vector>

#include "log_writer.h"
#include "radio/seal.h"

namespace twin
{

// Of a bus that is a log, file://PATH?mode=w; empty of all others. Throws std::runtime_error in one
// sentence if the mode is another.
std::string RecordingPath(const std::string &url);

class Outlet
{
public:
    // Opens a bus; an empty `url` is LCM's default on this machine alone, and one of a file is a
    // second log, which may replace one with `force`. Throws std::runtime_error in one sentence if
    // messages cannot be sent there.
    void OpenBus(const std::string &url, bool force);
    // As LogWriter's constructor.
    void OpenLog(const std::string &path, bool force)
    {
        log_ = std::make_unique<LogWriter>("--log", path, force);
    }
    void Finish();
    // Empty if there is no bus.
    const std::string &BusUrl() const { return bus_url_; }

    // `utime_us` is when the message is received: the log's time stamp.
    template <class Message>
    void Send(int64_t utime_us, const std::string &channel, const Message &message)
    {
        bytes_.resize(static_cast<size_t>(message.getEncodedSize()));
        message.encode(bytes_.data(), 0, static_cast<int>(bytes_.size()));
        SendBytes(utime_us, channel);
    }

    // The same of a message that ends in its tag.
    template <class Message>
    void SendSigned(int64_t utime_us, const std::string &channel, const Message &message,
                    const seal_key &key)
    {
        bytes_.resize(static_cast<size_t>(message.getEncodedSize()));
        message.encode(bytes_.data(), 0, static_cast<int>(bytes_.size()));
        seal_sign(&key, bytes_.data(), bytes_.size());
        SendBytes(utime_us, channel);
    }

private:
    void SendBytes(int64_t utime_us, const std::string &channel);

    std::unique_ptr<lcm::LCM> bus_;  // only sends: its receiver believes what packets claim
    std::string bus_url_;
    std::unique_ptr<LogWriter> recording_, log_;
    std::vector<uint8_t> bytes_;
};

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// Where messages go: an LCM bus, a log file, or both.
#ifndef APP_OUTLET_H
#define APP_OUTLET_H

#include <lcm/lcm-cpp.hpp>
#include <memory>
#include <string>
#include <vector>

namespace twin
{

// A log that stands under its name only once it is whole: written beside it, renamed by Finish().
class LogWriter
{
public:
    // Throws std::runtime_error in one sentence if the file cannot be made.
    explicit LogWriter(const std::string &path);
    ~LogWriter();
    LogWriter(const LogWriter &) = delete;
    LogWriter &operator=(const LogWriter &) = delete;

    // Throws std::runtime_error if the disk is full.
    void Write(int64_t utime_us, const std::string &channel, std::vector<uint8_t> &bytes);
    void Finish();

private:
    std::string path_, partial_path_;
    std::unique_ptr<lcm::LogFile> file_;
};

class Outlet
{
public:
    // Opens a bus; an empty `url` is LCM's default on this machine alone. Throws std::runtime_error
    // in one sentence if messages cannot be sent there.
    void OpenBus(const std::string &url);
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

// SPDX-License-Identifier: Apache-2.0
#include "outlet.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>

namespace twin
{

namespace
{

// The finished log is renamed over `path`: a device or a folder must not be replaced by it.
const std::string &Replaceable(const std::string &path)
{
    if (std::filesystem::exists(path) && !std::filesystem::is_regular_file(path))
        throw std::runtime_error("--log " + path + ": is no ordinary file; choose another name");
    return path;
}

}  // namespace

LogWriter::LogWriter(const std::string &path)
    : path_(Replaceable(path)),
      partial_path_(path + ".partial"),
      file_(std::make_unique<lcm::LogFile>(partial_path_, "w"))
{
    if (!file_->good())
        throw std::runtime_error("--log " + path + ": cannot be written: " + std::strerror(errno));
}

LogWriter::~LogWriter()
{
    file_.reset();
    std::error_code ignored;
    std::filesystem::remove(partial_path_, ignored);
}

void LogWriter::Write(int64_t utime_us, const std::string &channel, std::vector<uint8_t> &bytes)
{
    lcm::LogEvent event;
    event.timestamp = utime_us;
    event.channel = channel;
    event.datalen = static_cast<int32_t>(bytes.size());
    event.data = bytes.data();
    if (file_->writeEvent(&event) != 0)
        throw std::runtime_error("--log " + path_ + ": writing failed: " + std::strerror(errno));
}

void LogWriter::Finish()
{
    if (std::fflush(file_->getFilePtr()) != 0)
        throw std::runtime_error("--log " + path_ + ": writing failed: " + std::strerror(errno));
    file_.reset();
    std::filesystem::rename(partial_path_, path_);
}

void Outlet::OpenBus(const std::string &url)
{
    constexpr const char *kOwnMachine = "udpm://239.255.76.67:7667?ttl=0";
    const std::string where = url.empty() ? kOwnMachine : url;
    auto bus = std::make_unique<lcm::LCM>(where);
    if (!bus->good())
        throw std::runtime_error("LCM cannot send to " + where);
    bus_ = std::move(bus);
}

void Outlet::SendBytes(int64_t utime_us, const std::string &channel)
{
    if (bus_)
        bus_->publish(channel, bytes_.data(), static_cast<unsigned>(bytes_.size()));
    if (log_)
        log_->Write(utime_us, channel, bytes_);
}

void Outlet::Finish()
{
    if (log_)
        log_->Finish();
}

}  // namespace twin

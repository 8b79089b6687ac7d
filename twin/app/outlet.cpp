// SPDX-License-Identifier: Apache-2.0
#include "outlet.h"

#include <stdexcept>
#include <string_view>

namespace twin
{
namespace
{

constexpr std::string_view kFile = "file://", kModeWrite = "?mode=w";

}  // namespace

std::string RecordingPath(const std::string &url)
{
    if (!url.starts_with(kFile))
        return "";
    if (!url.ends_with(kModeWrite))
        throw std::runtime_error("--lcm-url " + url + ": a log is file://PATH?mode=w");
    return url.substr(kFile.size(), url.size() - kFile.size() - kModeWrite.size());
}

void Outlet::OpenBus(const std::string &url, bool force)
{
    if (const std::string path = RecordingPath(url); !path.empty())
    {
        // liblcm's is silent where the disk is full.
        recording_ = std::make_unique<LogWriter>("--lcm-url", path, force);
        return;
    }
    constexpr const char *kOwnMachine = "udpm://239.255.76.67:7667?ttl=0";
    const std::string where = url.empty() ? kOwnMachine : url;
    auto bus = std::make_unique<lcm::LCM>(where);
    if (!bus->good())
        throw std::runtime_error("LCM cannot send to " + where);
    bus_ = std::move(bus);
    bus_url_ = where;
}

void Outlet::SendBytes(int64_t utime_us, const std::string &channel)
{
    if (bus_)
        bus_->publish(channel, bytes_.data(), static_cast<unsigned>(bytes_.size()));
    for (const auto *log : {&recording_, &log_})
        if (*log)
            (*log)->Write(utime_us, channel, bytes_);
}

void Outlet::Finish()
{
    for (const auto *log : {&recording_, &log_})
        if (*log)
            (*log)->Finish();
}

}  // namespace twin

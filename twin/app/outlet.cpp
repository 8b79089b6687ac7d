// SPDX-License-Identifier: Apache-2.0
#include "outlet.h"

#include <stdexcept>

namespace twin
{

void Outlet::OpenBus(const std::string &url)
{
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
    if (log_)
        log_->Write(utime_us, channel, bytes_);
}

void Outlet::Finish()
{
    if (log_)
        log_->Finish();
}

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "log_writer.h"

#include <cstdio>

namespace twin
{

LogWriter::LogWriter(const std::string &option, const std::string &path, bool force)
    : file_(option, path, force), log_(lcm_eventlog_create(file_.Partial().c_str(), "w"))
{
    if (!log_)
        file_.Fail("cannot be written");
}

void LogWriter::Write(int64_t utime_us, const std::string &channel, std::vector<uint8_t> &bytes)
{
    std::string name = channel;
    lcm_eventlog_event_t event{};
    event.timestamp = utime_us;
    event.channellen = static_cast<int32_t>(name.size());
    event.channel = name.data();
    event.datalen = static_cast<int32_t>(bytes.size());
    event.data = bytes.data();
    if (lcm_eventlog_write_event(log_.get(), &event) != 0)
        file_.Fail("writing failed");
}

void LogWriter::Finish()
{
    if (std::fflush(log_->f) != 0)
        file_.Fail("writing failed");
    log_.reset();
    file_.Finish();
}

}  // namespace twin

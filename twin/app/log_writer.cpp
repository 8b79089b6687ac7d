// SPDX-License-Identifier: Apache-2.0
#include "log_writer.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>

namespace twin
{

std::string PartialPath(const std::string &path)
{
    return path + ".partial";
}

LogWriter::LogWriter(const std::string &path) : path_(path)
{
    log_.reset(lcm_eventlog_create(PartialPath(path_).c_str(), "w"));
    if (!log_)
        Fail("cannot be written");
}

LogWriter::~LogWriter()
{
    log_.reset();
    std::error_code ignored;
    std::filesystem::remove(PartialPath(path_), ignored);
}

void LogWriter::Fail(const char *what) const
{
    throw std::runtime_error("log " + path_ + ": " + what + ": " + std::strerror(errno));
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
        Fail("writing failed");
}

void LogWriter::Finish()
{
    if (std::fflush(log_->f) != 0)
        Fail("writing failed");
    log_.reset();
    std::filesystem::rename(PartialPath(path_), path_);
}

}  // namespace twin

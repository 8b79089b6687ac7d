// SPDX-License-Identifier: Apache-2.0
#include "log_writer.h"

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
        throw std::runtime_error("log " + path + ": is no ordinary file; choose another name");
    return path;
}

}  // namespace

LogWriter::LogWriter(const std::string &path) : path_(Replaceable(path))
{
    log_.reset(lcm_eventlog_create(PartialPath().c_str(), "w"));
    if (!log_)
        Fail("cannot be written");
}

LogWriter::~LogWriter()
{
    log_.reset();
    std::error_code ignored;
    std::filesystem::remove(PartialPath(), ignored);
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
    std::filesystem::rename(PartialPath(), path_);
}

}  // namespace twin

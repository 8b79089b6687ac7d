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
        throw std::runtime_error("--log " + path + ": is no ordinary file; choose another name");
    return path;
}

}  // namespace

std::string PartialPath(const std::string &path)
{
    return path + ".partial";
}

LogWriter::LogWriter(const std::string &path, bool resume) : path_(Replaceable(path))
{
    if (const std::string kept = resume ? FindKept(path) : ""; !kept.empty())
    {
        kept_.emplace(kept);
        resumed_ = true;
    }
    else
        Open("w");
}

LogWriter::~LogWriter()
{
    log_.reset();
    std::error_code ignored;
    if (!resumed_)
        std::filesystem::remove(PartialPath(path_), ignored);
}

void LogWriter::Fail(const char *what) const
{
    throw std::runtime_error("--log " + path_ + ": " + what + ": " + std::strerror(errno));
}

void LogWriter::Open(const char *mode)
{
    log_.reset(lcm_eventlog_create(PartialPath(path_).c_str(), mode));
    if (!log_)
        Fail("cannot be written");
}

// Behind the last whole message of what is kept.
void LogWriter::GoOn()
{
    const int64_t count = kept_->count();
    const std::string partial = PartialPath(path_);
    if (kept_->path() != partial)
        std::filesystem::rename(kept_->path(), partial);
    std::filesystem::resize_file(partial, static_cast<uintmax_t>(kept_->bytes()));
    kept_.reset();
    Open("a");
    log_->eventcount = count;
}

void LogWriter::Write(int64_t utime_us, const std::string &channel, std::vector<uint8_t> &bytes)
{
    if (kept_)
    {
        if (kept_->Holds(utime_us, channel, bytes))
            return;
        GoOn();
    }
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
    if (Repeats())
        return;
    if (kept_)
        GoOn();
    if (std::fflush(log_->f) != 0)
        Fail("writing failed");
    log_.reset();
    std::filesystem::rename(PartialPath(path_), path_);
}

}  // namespace twin

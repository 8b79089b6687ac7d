// SPDX-License-Identifier: Apache-2.0
#include "kept_log.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "log_writer.h"
#include "turbopi/run_t.hpp"

namespace twin
{
namespace
{

// The first words, or lines, in which two texts differ, with what stands before them.
struct Difference
{
    std::string kept, now;
};

std::vector<std::string> Split(const std::string &text, char at)
{
    std::vector<std::string> parts;
    std::istringstream stream(text);
    for (std::string part; std::getline(stream, part, at);)
        parts.push_back(part);
    return parts;
}

Difference FirstDifference(const std::string &kept, const std::string &now, char at)
{
    const auto a = Split(kept, at), b = Split(now, at);
    size_t i = 0;
    while (i < a.size() && i < b.size() && a[i] == b[i])
        ++i;
    const auto shown = [i](const std::vector<std::string> &parts) {
        return i < parts.size() ? parts[i] : std::string("nothing there");
    };
    Difference difference{shown(a), shown(b)};
    if (at == '\n' && i == 0)
        return FirstDifference(difference.kept, difference.now, ' ');
    if (at == ' ' && i > 0)
        difference = {a[i - 1] + " " + difference.kept, b[i - 1] + " " + difference.now};
    return difference;
}

[[noreturn]] void Refuse(const std::string &path, const std::string &kept, const std::string &now)
{
    throw std::runtime_error("--resume: " + path + " is of another run: it has '" + kept +
                             "', this one '" + now +
                             "'; repeat its command, or leave out --resume to begin anew");
}

std::optional<turbopi::run_t> FirstRun(const std::string &path)
{
    const LogHandle log(lcm_eventlog_create(path.c_str(), "r"));
    while (lcm_eventlog_event_t *event = log ? lcm_eventlog_read_next_event(log.get()) : nullptr)
    {
        const bool is_run = std::string(event->channel).ends_with("_RUN");
        turbopi::run_t run;
        const bool good = is_run && run.decode(event->data, 0, event->datalen) > 0;
        lcm_eventlog_free_event(event);
        if (good)
            return run;
    }
    return std::nullopt;
}

}  // namespace

KeptLog::KeptLog(const std::string &path)
    : path_(path), log_(lcm_eventlog_create(path.c_str(), "r"))
{
    if (!log_)
        throw std::runtime_error("--resume: " + path + " cannot be read: " + std::strerror(errno));
    ReadNext();
}

void KeptLog::ReadNext()
{
    next_.reset(lcm_eventlog_read_next_event(log_.get()));
    next_end_bytes_ = ftello(log_->f);
}

bool KeptLog::AtEnd()
{
    return !next_;
}

bool KeptLog::Holds(int64_t utime_us, const std::string &channel, const std::vector<uint8_t> &bytes)
{
    if (AtEnd())
        return false;
    const lcm_eventlog_event_t &event = *next_;
    if (event.eventnum != count_ || event.timestamp != utime_us || event.channel != channel ||
        static_cast<size_t>(event.datalen) != bytes.size() ||
        std::memcmp(event.data, bytes.data(), bytes.size()) != 0)
        throw std::runtime_error(
            "--resume: message " + std::to_string(count_) + " of " + path_ + ", on " +
            event.channel + ", is not what this run says there on " + channel +
            ": a file that the run needs, or the program, has changed, or the log is damaged; "
            "leave out --resume to begin anew");
    ++count_;
    bytes_ = next_end_bytes_;
    ReadNext();
    return true;
}

std::string FindKept(const std::string &path)
{
    for (const std::string &candidate : {PartialPath(path), path})
        if (std::filesystem::exists(candidate))
            return candidate;
    return "";
}

void CheckSameRequest(const std::string &path, const std::string &config_toml)
{
    const std::optional<turbopi::run_t> run = FirstRun(path);
    if (!run)
        return;
    if (run->version != TWINMILL_VERSION)
        Refuse(path, "version " + run->version, "version " TWINMILL_VERSION);
    if (run->config_toml == config_toml)
        return;
    const Difference difference = FirstDifference(run->config_toml, config_toml, '\n');
    Refuse(path, difference.kept, difference.now);
}

}  // namespace twin

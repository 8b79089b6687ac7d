// SPDX-License-Identifier: Apache-2.0
// What an interrupted run left of its log, to be repeated and then gone on with. A run depends on
// nothing but its options, so that all of it is computed anew; what is kept only has to agree.
#ifndef APP_KEPT_LOG_H
#define APP_KEPT_LOG_H

#include <lcm/eventlog.h>
#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace twin
{

struct CloseLog
{
    void operator()(lcm_eventlog_t *log) const { lcm_eventlog_destroy(log); }
};
using LogHandle = std::unique_ptr<lcm_eventlog_t, CloseLog>;

class KeptLog
{
public:
    // Throws std::runtime_error in one sentence if `path` cannot be read.
    explicit KeptLog(const std::string &path);

    // True if the next message is this one, false if no whole message follows. Throws
    // std::runtime_error in one sentence if another one does.
    bool Holds(int64_t utime_us, const std::string &channel, const std::vector<uint8_t> &bytes);
    bool AtEnd();

    const std::string &path() const { return path_; }
    // Of the messages that were found.
    int64_t count() const { return count_; }
    off_t bytes() const { return bytes_; }

private:
    struct FreeEvent
    {
        void operator()(lcm_eventlog_event_t *event) const { lcm_eventlog_free_event(event); }
    };
    void ReadNext();

    std::string path_;
    LogHandle log_;
    std::unique_ptr<lcm_eventlog_event_t, FreeEvent> next_;
    int64_t count_ = 0;
    off_t bytes_ = 0, next_end_bytes_ = 0;
};

// Where a run that was to write `path` left its messages: beside it if it was killed, there if it
// was told to stop; empty if nowhere.
std::string FindKept(const std::string &path);

// Throws std::runtime_error in one sentence, with the first difference, if the log was written by
// another version, or for another request than the one that `config_toml` of run_t describes.
void CheckSameRequest(const std::string &path, const std::string &config_toml);

}  // namespace twin

#endif

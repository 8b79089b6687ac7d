// SPDX-License-Identifier: Apache-2.0
// A log that stands under its name only once it is whole: written beside it, renamed at the end.
#ifndef APP_LOG_WRITER_H
#define APP_LOG_WRITER_H

#include <optional>
#include <string>
#include <vector>

#include "kept_log.h"

namespace twin
{

// Where the log `path` is written until it is whole.
std::string PartialPath(const std::string &path);

class LogWriter
{
public:
    // `resume`: what an interrupted run left is compared with what is written, and only what comes
    // after it is added. Until then it is not touched, and from then on it is never removed.
    // Throws std::runtime_error in one sentence if the file cannot be made or read.
    LogWriter(const std::string &path, bool resume);
    ~LogWriter();
    LogWriter(const LogWriter &) = delete;
    LogWriter &operator=(const LogWriter &) = delete;

    // Throws std::runtime_error if the disk is full, or what is kept is something else.
    void Write(int64_t utime_us, const std::string &channel, std::vector<uint8_t> &bytes);
    // What is kept of an interrupted run holds more than was written so far.
    bool Repeats() { return kept_ && !kept_->AtEnd(); }
    // Leaves a log that still repeats as it was.
    void Finish();

private:
    void Open(const char *mode);
    void GoOn();
    [[noreturn]] void Fail(const char *what) const;

    std::string path_;
    LogHandle log_;
    std::optional<KeptLog> kept_;
    bool resumed_ = false;
};

}  // namespace twin

#endif

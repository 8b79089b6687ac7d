// SPDX-License-Identifier: Apache-2.0
// A log that stands under its name only once it is whole: written beside it, renamed at the end.
#ifndef APP_LOG_WRITER_H
#define APP_LOG_WRITER_H

#include <lcm/eventlog.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace twin
{

// What is not finished is written here.
std::string PartialPath(const std::string &path);

class LogWriter
{
public:
    // Throws std::runtime_error in one sentence if the file cannot be made.
    explicit LogWriter(const std::string &path);
    // Removes what is not finished; a killed program leaves `path`.partial, which is readable.
    ~LogWriter();
    LogWriter(const LogWriter &) = delete;
    LogWriter &operator=(const LogWriter &) = delete;

    // Throws std::runtime_error if the disk is full.
    void Write(int64_t utime_us, const std::string &channel, std::vector<uint8_t> &bytes);
    void Finish();

private:
    struct CloseLog
    {
        void operator()(lcm_eventlog_t *log) const { lcm_eventlog_destroy(log); }
    };
    [[noreturn]] void Fail(const char *what) const;

    std::string path_;
    std::unique_ptr<lcm_eventlog_t, CloseLog> log_;
};

}  // namespace twin

#endif

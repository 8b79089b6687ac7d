// SPDX-License-Identifier: Apache-2.0
// A log that stands under its name only once it is whole; what a killed program leaves is readable.
#ifndef APP_LOG_WRITER_H
#define APP_LOG_WRITER_H

#include <lcm/eventlog.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "new_file.h"

namespace twin
{

class LogWriter
{
public:
    // As NewFile's constructor.
    LogWriter(const std::string &option, const std::string &path, bool force);

    // Throws std::runtime_error if the disk is full.
    void Write(int64_t utime_us, const std::string &channel, std::vector<uint8_t> &bytes);
    // As NewFile's.
    void Finish();

private:
    struct CloseLog
    {
        void operator()(lcm_eventlog_t *log) const { lcm_eventlog_destroy(log); }
    };

    NewFile file_;
    std::unique_ptr<lcm_eventlog_t, CloseLog> log_;
};

}  // namespace twin

#endif

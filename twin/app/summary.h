// SPDX-License-Identifier: Apache-2.0
// What a run tells the person or the program that started it.
#ifndef APP_SUMMARY_H
#define APP_SUMMARY_H

#include <string>

#include "options.h"
#include "swarm/metrics.h"
#include "swarm/swarm.h"

namespace twin
{

struct Result
{
    std::string command_line;
    int robots;
    double period_s, simulated_s, wall_s;
    bool interrupted;
    Metrics mean;  // over the last 10 s, of the poses as they were published
};

void PrintHeader(const Options &options, const Swarm &swarm, bool on_bus, double realtime_factor);

// A line that overwrites itself; nothing unless a person looks on.
class Progress
{
public:
    bool IsDue(double wall_s) const;
    void Show(double t_s, std::optional<double> duration_s, double wall_s, const Metrics &now);
    void Clear();

private:
    double shown_wall_s_ = 0;
};

// Text, or one JSON object, on stdout.
void PrintSummary(const Options &options, const Result &result);

// The object of a run that failed before it had one.
void PrintFailure(const std::string &sentence);

}  // namespace twin

#endif

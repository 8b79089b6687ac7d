// SPDX-License-Identifier: Apache-2.0
#include "summary.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

namespace twin
{
namespace
{

constexpr double kShowEvery_s = 0.5;

std::string Format(const char *format, double value)
{
    char text[64];
    std::snprintf(text, sizeof text, format, value);
    return text;
}

// Of the terminal that stderr is.
size_t Columns()
{
    winsize size{};
    return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col ? size.ws_col : 80;
}

// As many of the parts as stand in one line, which could not be written over otherwise.
std::string Joined(const std::vector<std::string> &parts, size_t columns)
{
    std::string line = parts.front();
    for (size_t i = 1; i < parts.size(); ++i)
        if (line.size() + 2 + parts[i].size() < columns)
            line += ", " + parts[i];
    return line;
}

void PrintText(const Options &options, const Result &result)
{
    const Metrics &m = result.mean;
    std::printf("%s after %.2f s in %.2f s: %.1f times real time\n",
                result.interrupted ? "stopped" : "done", result.simulated_s, result.wall_s,
                result.simulated_s / result.wall_s);
    if (result.robots > 1)
        std::printf(
            "last 10 s: %s; circliness %.3f, radius %.3f m, rotation %+.2f, groups %.1f, "
            "contacts %.1f\n",
            Classify(m), m.circliness, m.radius_m, m.rotation, m.groups, m.contacts);
    if (!options.log.empty())
        std::printf("log: %s\n", options.log.c_str());
}

void PrintJson(const Options &options, const Result &result)
{
    const Metrics &m = result.mean;
    nlohmann::ordered_json summary;
    summary["command_line"] = result.command_line;
    summary["version"] = TWINMILL_VERSION;
    summary["n"] = result.robots;
    summary["seed"] = options.seed;
    summary["control_period_s"] = result.period_s;
    summary["simulated_s"] = result.simulated_s;
    summary["wall_s"] = result.wall_s;
    summary["realtime_factor"] = result.simulated_s / result.wall_s;
    summary["interrupted"] = result.interrupted;
    if (!options.log.empty())
        summary["log"] = options.log;
    summary["class"] = Classify(m);
    summary["metrics"] = {{"circliness", m.circliness}, {"radius_m", m.radius_m},
                          {"scatter_m2", m.scatter_m2}, {"rotation", m.rotation},
                          {"odd_ratio", m.odd_ratio},   {"diffusion", m.diffusion},
                          {"groups", m.groups},         {"contacts", m.contacts}};
    std::printf("%s\n", summary.dump(2).c_str());
}

}  // namespace

void PrintFailure(const std::string &sentence)
{
    const nlohmann::ordered_json failure{
        {"verdict", "bad_input"}, {"sentence", sentence}, {"input", nlohmann::json::array()}};
    // File names may be of any bytes.
    std::printf("%s\n",
                failure.dump(2, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
    std::fflush(stdout);
}

void PrintHeader(const Options &options, const Swarm &swarm, bool on_bus, double realtime_factor)
{
    std::FILE *out = options.json ? stderr : stdout;
    std::fprintf(out, "%d robot%s, %s plant, model %s, %s, seed %llu, control period %.1f ms\n",
                 swarm.Size(), swarm.Size() == 1 ? "" : "s", PlantName(options.plant),
                 options.model.c_str(),
                 options.script.empty() ? options.behavior.c_str() : options.script.c_str(),
                 static_cast<unsigned long long>(options.seed), swarm.PeriodS() * 1000);
    std::fprintf(out, "publishing %s%s%s, %s\n", on_bus ? "on the LCM bus" : "",
                 on_bus && !options.log.empty() ? " and " : "",
                 options.log.empty() ? "" : ("to " + options.log).c_str(),
                 realtime_factor > 0 ? "in step with the clock" : "as fast as possible");
    std::fflush(out);
}

bool Progress::IsDue(double wall_s) const
{
    static const bool person = isatty(STDERR_FILENO);
    return person && wall_s >= shown_wall_s_ + kShowEvery_s;
}

void Progress::Show(double t_s, std::optional<double> duration_s, double wall_s, const Metrics &now)
{
    shown_wall_s_ = wall_s;
    std::vector<std::string> parts{Format("%.1f s", t_s)};
    if (duration_s && t_s > 0)
        parts.push_back(Format("%.0f s left", (*duration_s - t_s) * wall_s / t_s));
    parts.push_back(Format("circliness %.3f", now.circliness));
    parts.push_back(Format("%.1f times real time", t_s / wall_s));
    std::fprintf(stderr, "\r%s\x1b[K", Joined(parts, Columns()).c_str());
    std::fflush(stderr);
}

void Progress::Clear()
{
    if (shown_wall_s_ > 0)
        std::fprintf(stderr, "\r\x1b[K");
}

void PrintSummary(const Options &options, const Result &result)
{
    if (options.json)
        PrintJson(options, result);
    else
        PrintText(options, result);
}

}  // namespace twin

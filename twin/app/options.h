// SPDX-License-Identifier: Apache-2.0
// The command line of twin_run.
#ifndef APP_OPTIONS_H
#define APP_OPTIONS_H

#include <cstdint>
#include <optional>
#include <string>

#include "camera_options.h"
#include "hil_options.h"
#include "model_file/model.h"
#include "swarm/starts.h"

namespace twin
{

struct Options
{
    std::string mjcf = "turbopi.xml", model = "turbopi.toml", behavior = "milling_cmaes";
    PlantKind plant = PlantKind::kMujoco;
    std::string sensor = "cone";
    CameraOptions camera;
    HilOptions hil;
    std::optional<int> n;
    uint64_t seed = 1;
    StartShape start = StartShape::kFacingOut;
    double spread_m = 1.2;  // of square and disc
    std::optional<double> duration_s, dt_s, realtime_factor;
    double pose_rate_hz = 120;
    std::string script, behaviors, world, log, channel_prefix, script_dir = ".", key;
    bool force = false, wait = false;
    std::optional<std::string> lcm_url;
    std::optional<int64_t> epoch_us;
    bool view = false;
    std::string picture, video;
    bool json = false;

    // Messages go to the bus unless only a log is asked for.
    bool UsesBus() const { return log.empty() || lcm_url.has_value(); }
};

// Thrown when the command line asks for no run: help, or a mistake. `text` is what to
// print, or the sentence on the mistake.
struct NoRun
{
    std::string text;
    int exit_code;
};

// Throws NoRun.
Options ParseOptions(int argc, const char *const *argv);

// The command line that repeats a run, every choice that matters to it spelled out.
std::string CommandLine(const Options &options, size_t robots, int64_t epoch_us);

const char *PlantName(PlantKind plant);

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
#include "hil_options.h"

#include <CLI/CLI.hpp>
#include <filesystem>

#include "hil/firmware_sensor.h"

namespace twin
{

void AddHilOptions(CLI::App &app, HilOptions &options)
{
    CLI::Option *hil =
        app.add_option("--hil", options.robots,
                       "so many robots, from the first, are driven by the robot's own program, "
                       "which is sent camera frames and answers with duties")
            ->check(CLI::Range(0, 100))
            ->capture_default_str();
    app.add_option("--firmware", options.program, "that program; default: turbopi beside twin_run")
        ->needs(hil);
    app.add_flag("--free-run", options.free_run,
                 "takes the program's newest duties instead of waiting for those to each frame; "
                 "the same seed then no longer gives the same run")
        ->needs(hil);
    hil->excludes(app.get_option("--script"));
}

std::string HilWords(const HilOptions &options)
{
    if (options.robots == 0)
        return "";
    return " --hil " + std::to_string(options.robots) +
           (options.program.empty() ? "" : " --firmware " + options.program) +
           (options.free_run ? " --free-run" : "");
}

void UseFirmware(Swarm &swarm, const HilOptions &options, const CameraWorld &world,
                 const std::vector<Model> &robots,
                 const std::vector<const fw_behavior *> &behaviors, uint64_t seed)
{
    if (options.robots > swarm.Size())
        throw std::runtime_error("--hil " + std::to_string(options.robots) + ": there are only " +
                                 std::to_string(swarm.Size()) + " robots (--n)");
    std::string program = options.program;
    if (program.empty())
        program = std::filesystem::read_symlink("/proc/self/exe").parent_path() / "turbopi";
    for (int i = 0; i < options.robots; ++i)
    {
        const size_t k = static_cast<size_t>(i);
        const DetectionModel detection = CameraDetectionModel(robots[k], world);
        const FirmwareOptions firmware{program, behaviors[k]->name, behaviors[k]->table,
                                       robots[k].sensor.bits, !options.free_run};
        swarm.SetSensor(i, std::make_unique<FirmwareSensor>(firmware, world, i, detection, seed));
    }
}

}  // namespace twin

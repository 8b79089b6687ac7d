// SPDX-License-Identifier: Apache-2.0
// Two robots that meet head-on in MuJoCo: how often they hold each other, by hull and motors.
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "fw/behavior.h"
#include "plant_mujoco/mujoco_plant.h"
#include "sweep/worlds.h"

namespace
{

namespace fs = std::filesystem;
using namespace twin;

constexpr int kMeetings = 24;
constexpr double kDuration_s = 25, kApart_m = 0.6, kAside_m = 0.08, kAskew_rad = 0.2;

struct Variant
{
    const char *name;
    std::string from, to;  // of the robot's files
};

const Variant kVariants[] = {
    {"as installed: box, friction 0.3, 0.10 N m", "", ""},
    {"hull friction 0.05", "friction=\"0.3\"", "friction=\"0.05\""},
    {"hull friction 0.1", "friction=\"0.3\"", "friction=\"0.1\""},
    {"hull friction 0.6", "friction=\"0.3\"", "friction=\"0.6\""},
    {"hull friction 1.0", "friction=\"0.3\"", "friction=\"1.0\""},
    {"hull a cylinder of 0.095 m", "<geom name=\"hull\" class=\"hull\" size=\"0.095 0.08 0.055\"",
     "<geom name=\"hull\" class=\"hull\" type=\"cylinder\" size=\"0.095 0.055\""},
    {"hull an ellipsoid, 0.095 by 0.08 m", "<geom name=\"hull\" class=\"hull\" size=\"0.095 0.08",
     "<geom name=\"hull\" class=\"hull\" type=\"ellipsoid\" size=\"0.095 0.08"},
    {"motors of 0.05 N m", "forcerange=\"-0.1 0.1\"", "forcerange=\"-0.05 0.05\""},
    {"motors of 0.20 N m", "forcerange=\"-0.1 0.1\"", "forcerange=\"-0.2 0.2\""},
    {"wheels that grip by 0.4 for 0.8", "friction=\"0.8\"", "friction=\"0.4\""},
};

// Copies of the robot's files with one text changed; the robot's path. Ends if the text is not
// there.
std::string Changed(const Variant &variant, const fs::path &to)
{
    const fs::path from = fs::path(FindModelFile("turbopi.xml")).parent_path();
    fs::create_directories(to);
    bool found = variant.from.empty();
    for (const char *name : {"turbopi.xml", "turbopi_chassis.xml", "turbopi_parts.xml"})
    {
        std::ostringstream text;
        text << std::ifstream(from / name).rdbuf();
        std::string changed = text.str();
        const size_t at = variant.from.empty() ? std::string::npos : changed.find(variant.from);
        if (at != std::string::npos)
        {
            changed.replace(at, variant.from.size(), variant.to);
            found = true;
        }
        std::ofstream(to / name) << changed;
    }
    if (!found)
        throw std::runtime_error(std::string(variant.name) + ": nothing to change in the files");
    return (to / "turbopi.xml").string();
}

// They face each other, a little aside and askew.
std::vector<Cell> Meetings(const char *behavior)
{
    Random random(1, 0, "meetings");
    const auto within = [&](double most) { return most * (2 * random.Uniform() - 1); };
    Cell cell{Model::Load("turbopi.toml"), {2, fw_behavior_find(behavior)->table}, 2};
    std::vector<Cell> cells;
    for (int k = 0; k < kMeetings; ++k)
    {
        cell.poses = {{0, 0, within(kAskew_rad)},
                      {kApart_m, within(kAside_m), M_PI + within(kAskew_rad)}};
        cells.push_back(cell);
    }
    return cells;
}

// How many hold each other over the last 10 s.
int Held(const std::string &mjcf, const std::vector<Cell> &cells)
{
    const auto make = [&](const std::vector<Model> &models, const std::vector<Pose2> &starts,
                          uint64_t seed, const std::vector<WorldBody> &) {
        return std::make_unique<MujocoPlant>(mjcf, models, starts, SweepOptions(seed));
    };
    int held = 0;
    for (size_t k = 0; k < cells.size(); ++k)
    {
        const World world{&cells[k], k + 1};
        held += RunWorldsIn(make, {&world, 1}, kDuration_s)[0].mean.contacts > 0.5;
    }
    return held;
}

}  // namespace

int main()
{
    const fs::path folder = fs::temp_directory_path() / ("jams_" + std::to_string(getpid()));
    std::printf(
        "| of %d meetings, still in contact after %g s | `milling` | `milling_cmaes` |\n"
        "|---|---|---|\n",
        kMeetings, kDuration_s);
    for (const Variant &variant : kVariants)
    {
        const std::string mjcf = Changed(variant, folder);
        std::printf("| %s | %d | %d |\n", variant.name, Held(mjcf, Meetings("milling")),
                    Held(mjcf, Meetings("milling_cmaes")));
        std::fflush(stdout);
    }
    fs::remove_all(folder);
}

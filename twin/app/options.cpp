// SPDX-License-Identifier: Apache-2.0
#include "options.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <limits>
#include <map>
#include <sstream>

#include "plant/plant.h"
#include "sensors.h"

namespace twin
{
namespace
{

const std::map<std::string, PlantKind> kPlants{{"mujoco", PlantKind::kMujoco},
                                               {"planar", PlantKind::kPlanar}};
const std::map<std::string, StartShape> kStarts{{"disc", StartShape::kDisc},
                                                {"facing-out", StartShape::kFacingOut},
                                                {"square", StartShape::kSquare}};
constexpr double kLongest_s = 1e7;

template <class Kind>
const char *NameOf(const std::map<std::string, Kind> &names, Kind kind)
{
    for (const auto &[name, other] : names)
        if (other == kind)
            return name.c_str();
    return "";
}

// An option whose value is one of `names`.
template <class Kind>
void AddChoice(CLI::App &app, const std::string &option, Kind &value,
               const std::map<std::string, Kind> &names, const std::string &doc)
{
    std::vector<std::string> words;
    for (const auto &[name, kind] : names)
        words.push_back(name);
    app.add_option_function<std::string>(
           option, [&value, &names](const std::string &name) { value = names.at(name); }, doc)
        ->check(CLI::IsMember(words))
        ->default_str(NameOf(names, value));
}

void AddWorld(CLI::App &app, Options &o)
{
    app.add_option("--mjcf", o.mjcf, "MJCF file of the robot, here or among the installed models")
        ->capture_default_str();
    app.add_option("--model", o.model, "model file, here or among the installed models")
        ->capture_default_str();
    AddChoice(app, "--plant", o.plant, kPlants, "what moves the robots");
    app.add_option("--sensor", o.sensor, "what gives the bit")
        ->check(CLI::IsMember(SensorNames()))
        ->capture_default_str();
    app.add_option("--n", o.n, "robots; default 6, or the sum of the counts in --behavior")
        ->check(CLI::Range(1, kMaxRobots));
    app.add_option("--behavior", o.behavior, "one for all, or milling:5,self_centering:1")
        ->capture_default_str();
    app.add_option("--behaviors", o.behaviors,
                   "TOML file of tables of your own; default: behaviors.toml here, else in "
                   "~/.config/twinmill")
        ->check(CLI::ExistingFile);
    app.add_option("--world", o.world,
                   "TOML file of bodies that are seen and in the way: obstacles, walls, goals, "
                   "evaders")
        ->check(CLI::ExistingFile);
    app.add_option("--script", o.script, "CSV of inputs or duties that all play instead")
        ->check(CLI::ExistingFile);
    app.add_option("--seed", o.seed, "same seed, same run")
        ->check(CLI::Range(uint64_t{0}, uint64_t{std::numeric_limits<int64_t>::max()}))
        ->capture_default_str();
    AddChoice(app, "--start", o.start, kStarts,
              "where they start; default with --spread-m: square");
    app.add_option("--spread-m", o.spread_m, "side of the square, diameter of the disc")
        ->check(CLI::Range(0.01, 1000.0))
        ->capture_default_str();
    app.add_option("--dt-s", o.dt_s, "control period; default: the model's")
        ->check(CLI::Range(0.001, 1.0));
}

void AddOutput(CLI::App &app, Options &o)
{
    app.add_option("--duration-s", o.duration_s,
                   "simulated time; default: the script's, else until Ctrl-C")
        ->check(CLI::Range(0.001, kLongest_s));
    app.add_option("--realtime-factor", o.realtime_factor,
                   "1 = real time, 0 = as fast as possible; default 1, but 0 if it only logs for a "
                   "given time")
        ->check(CLI::Range(0.0, 1e6));
    app.add_option("--log", o.log, "write an LCM log; alone, nothing goes to the bus");
    app.add_flag("--force", o.force, "replace files that exist");
    app.add_option("--lcm-url", o.lcm_url,
                   "bus; default udpm://239.255.76.67:7667?ttl=0, memq:// for none");
    app.add_option("--channel-prefix", o.channel_prefix,
                   "put before every channel but the truth's, e.g. TWIN_");
    app.add_flag("--wait", o.wait, "stand until `twinmill swarm start`, heard on the bus");
    app.add_option("--key", o.key,
                   "file of the operator's key, by which commands are signed; made if it is not "
                   "there; default: twinmill/swarm.key in ~/.config");
    app.add_option("--script-dir", o.script_dir, "folder of the scripts that commands name")
        ->check(CLI::ExistingDirectory)
        ->capture_default_str();
    app.add_option("--pose-rate-hz", o.pose_rate_hz, "poses a second")
        ->check(CLI::Range(0.1, 10000.0))
        ->capture_default_str();
    app.add_option(
           "--epoch-us", o.epoch_us,
           "time stamp of the start; default: now on the bus, 1700000000000000 in a log alone")
        ->check(CLI::Range(int64_t{0}, int64_t{4000000000000000}));
    app.add_flag("--view", o.view, "opens a window; needs a display");
    app.add_option("--picture", o.picture, "PNG file of the end; needs no display");
    app.add_option("--video", o.video, "MP4 file of the run; needs no display");
    app.add_flag("--json", o.json, "one JSON object on stdout, the rest on stderr");
}

// NaN passes every range, since no comparison with it is true.
std::string RefuseNan(const std::string &text)
{
    double value = 0;
    const bool is_nan = CLI::detail::lexical_cast(text, value) && std::isnan(value);
    return is_nan ? text + " is no number; give one" : "";
}

void RefuseNanEverywhere(CLI::App &app)
{
    for (CLI::Option *option : app.get_options())
        if (option->get_type_name().rfind("FLOAT", 0) == 0)
            option->check(RefuseNan);
}

std::string FirstLine(const std::string &text)
{
    return text.substr(0, text.find('\n'));
}

}  // namespace

Options ParseOptions(int argc, const char *const *argv)
{
    Options options;
    CLI::App app{"Runs a swarm of simulated robots and publishes what real ones would, on LCM."};
    app.footer(
        "Example: twin_run --mjcf turbopi.xml --n 8\n"
        "Exit: 0 done or stopped by Ctrl-C, 1 failed, 2 wrong command line.");
    app.set_version_flag("--version", "twin_run " TWINMILL_VERSION);
    AddWorld(app, options);
    AddCameraOptions(app, options.camera);
    AddHilOptions(app, options.hil);
    AddOutput(app, options);
    RefuseNanEverywhere(app);
    try
    {
        app.parse(argc, argv);
        if (app.count("--spread-m") > 0 && app.count("--start") == 0)
            options.start = StartShape::kSquare;
    }
    catch (const CLI::CallForVersion &)
    {
        throw NoRun{"twin_run " TWINMILL_VERSION "\n", 0};
    }
    catch (const CLI::CallForHelp &)
    {
        throw NoRun{app.help(), 0};
    }
    catch (const CLI::ParseError &error)
    {
        throw NoRun{FirstLine(error.what()) + " (--help lists the options)", 2};
    }
    return options;
}

const char *PlantName(PlantKind plant)
{
    return NameOf(kPlants, plant);
}

std::string CommandLine(const Options &o, size_t robots, int64_t epoch_us)
{
    std::ostringstream line;
    line << "twin_run --plant " << PlantName(o.plant);
    if (o.plant == PlantKind::kMujoco)
        line << " --mjcf " << o.mjcf;
    line << " --model " << o.model << " --sensor " << o.sensor << " --n " << robots
         << " --behavior " << o.behavior << " --seed " << o.seed << " --start "
         << NameOf(kStarts, o.start) << " --spread-m " << o.spread_m << " --pose-rate-hz "
         << o.pose_rate_hz << " --epoch-us " << epoch_us;
    if (o.sensor == "camera" || o.hil.robots > 0)
        line << CameraWords(o.camera);
    line << HilWords(o.hil);
    if (o.dt_s)
        line << " --dt-s " << *o.dt_s;
    if (o.duration_s)
        line << " --duration-s " << *o.duration_s;
    if (!o.behaviors.empty())
        line << " --behaviors " << o.behaviors;
    if (!o.world.empty())
        line << " --world " << o.world;
    if (!o.script.empty())
        line << " --script " << o.script;
    if (!o.channel_prefix.empty())
        line << " --channel-prefix " << o.channel_prefix;
    return line.str();
}

}  // namespace twin

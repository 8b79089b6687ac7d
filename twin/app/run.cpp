// SPDX-License-Identifier: Apache-2.0
#include "run.h"

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <thread>
#include <vector>

#include "behaviors.h"
#include "commands.h"
#include "key.h"
#include "outputs.h"
#include "plant_mujoco/mujoco_plant.h"
#include "publisher.h"
#include "sensors.h"
#include "show.h"
#include "summary.h"
#include "swarm/bodies.h"
#include "swarm/bounds.h"
#include "swarm/metrics.h"
#include "swarm/robots.h"
#include "swarm/species.h"
#include "swarm/world_file.h"

namespace twin
{
namespace
{

using Clock = std::chrono::steady_clock;

// Poses between steps are interpolated: right to 0.02 mm even while a robot starts.
constexpr double kMaxStep_s = 0.0055;
// Distractors lie this many spreads of the start away.
constexpr double kRing = 1.5;
// A fixed date, so that a log depends on nothing but its options: 2023-11-14 22:13:20 UTC.
constexpr int64_t kLogEpoch_us = 1'700'000'000'000'000;

volatile std::sig_atomic_t g_stop = 0;

// What a run is made of, before it moves.
struct Setup
{
    Model model;
    std::vector<Model> robots;
    OwnBehaviors own;
    std::vector<const fw_behavior *> behaviors;
    std::vector<WorldBody> world;
    int64_t start_utime_us;
    std::string command_line;
};

int64_t StartUtimeUs(const Options &options)
{
    if (options.epoch_us)
        return *options.epoch_us;
    if (!options.UsesBus())
        return kLogEpoch_us;
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    return std::chrono::duration_cast<std::chrono::microseconds>(now).count();
}

Setup Prepare(const Options &options)
{
    Setup setup;
    setup.model = Model::Load(options.model);
    setup.model.base.control_period_s = options.dt_s.value_or(setup.model.base.control_period_s);
    setup.own = OwnBehaviors(options.behaviors);
    setup.behaviors = ParseSpecies(options.behavior, options.n, setup.own.All());
    setup.world = LoadWorld(options.world);
    const int n = static_cast<int>(setup.behaviors.size());
    setup.robots = DrawRobots(setup.model, n, options.seed);
    setup.start_utime_us = StartUtimeUs(options);
    setup.command_line = CommandLine(options, setup.behaviors.size(), setup.start_utime_us);
    return setup;
}

std::unique_ptr<Plant> MakePlant(const Options &options, const Setup &setup)
{
    const double radius_m = setup.model.robot.body_radius_m;
    const auto starts = StartPoses(options.start, static_cast<int>(setup.robots.size()),
                                   options.spread_m, radius_m, options.seed, setup.world);
    if (options.plant == PlantKind::kPlanar)
        return std::make_unique<PlanarBodies>(setup.robots, starts, options.seed, kGridPays,
                                              setup.world);
    const WheelKind wheels = setup.model.base.wheels;
    // The installed robot has mecanum wheels: others are made of their model's numbers.
    const bool is_made = options.mjcf == Options{}.mjcf && wheels != WheelKind::kMecanum &&
                         wheels != WheelKind::kNone;
    return std::make_unique<MujocoPlant>(is_made ? "" : FindModelFile(options.mjcf), setup.robots,
                                         starts,
                                         MujocoOptions{.seed = options.seed, .world = setup.world});
}

Swarm MakeSwarm(const Options &options, const Setup &setup,
                const std::shared_ptr<const Script> &script)
{
    std::vector<fw_table> tables;
    for (const fw_behavior *behavior : setup.behaviors)
        tables.push_back(behavior->table);
    Swarm swarm(MakePlant(options, setup), setup.robots, tables,
                {.seed = options.seed,
                 .start_utime_us = setup.start_utime_us,
                 .max_step_s = kMaxStep_s,
                 .colours = ParseColours(options.behavior, options.n),
                 .world = setup.world});
    for (int robot = 0; robot < swarm.Size(); ++robot)
        swarm.Play(robot, script);
    const CameraWorld world =
        MakeCameraWorld(options.camera, kRing * options.spread_m, options.seed);
    UseSensor(options.sensor, swarm, world, setup.robots, options.seed);
    UseFirmware(swarm, options.hil, world, setup.robots, setup.behaviors, options.seed);
    return swarm;
}

// The model file as it is, under comments that say how to repeat the run.
std::vector<Publisher::Robot> DescribeRobots(const Options &options, const Setup &setup)
{
    std::ostringstream model_text;
    model_text << std::ifstream(FindModelFile(options.model), std::ios::binary).rdbuf();
    std::vector<Publisher::Robot> robots;
    for (const fw_behavior *behavior : setup.behaviors)
    {
        std::ostringstream config;
        config << "# " << setup.command_line << "\n# seed = " << options.seed << ", table "
               << behavior->name << " = " << TableText(behavior->table) << "\n"
               << model_text.str();
        robots.push_back({behavior->name, config.str()});
    }
    return robots;
}

// True if there is a bus. Without one a log may do, but a person is told.
bool OpenOutlet(const Options &options, Outlet &outlet)
{
    if (!options.log.empty())
        outlet.OpenLog(options.log, options.force);
    if (!options.UsesBus())
        return false;
    try
    {
        outlet.OpenBus(options.lcm_url.value_or(""), options.force);
        return true;
    }
    catch (const std::runtime_error &error)
    {
        if (options.log.empty())
            throw std::runtime_error(std::string(error.what()) +
                                     ": give --log FILE, or the machine a route for multicast (ip "
                                     "route add 224.0.0.0/4 dev lo)");
        std::fprintf(stderr, "twin_run: %s: only the log is written\n", error.what());
        return false;
    }
}

// Steps, publishes and measures until the time is over or a signal comes.
class Loop
{
public:
    Loop(const Options &options, const Setup &setup, std::optional<double> duration_s,
         double realtime_factor)
        : duration_s_(duration_s),
          realtime_factor_(realtime_factor),
          ring_(RingOf(setup.behaviors)),
          scale_{setup.model.sensor.range_m, setup.model.robot.body_radius_m},
          show_(!options.json)
    {
    }

    void Turn(Swarm &swarm, Publisher &publisher, Commands &commands, Views &views)
    {
        publisher.PublishPoses(swarm);
        while (!g_stop && !(duration_s_ && swarm.TimeS() >= *duration_s_ - swarm.PeriodS() / 2))
        {
            commands.Obey();
            swarm.Decide();
            publisher.PublishDecisions(swarm);
            for (int i = 0; i < swarm.Substeps(); ++i)
            {
                swarm.Advance();
                KeepPace(swarm.TimeS());
                publisher.PublishPoses(swarm);
            }
            bounds_.Check(swarm);
            Observe(swarm);
            begin_ += ToClock(views.Show(swarm));
            if (views.Closed())
                RequestStop();
        }
        progress_.Clear();
    }

    double WallS() const { return std::chrono::duration<double>(Clock::now() - begin_).count(); }
    // Of the poses as they were published: what `twinmill swarm metrics` says of the log.
    Metrics Mean(const Publisher &publisher) const
    {
        return publisher.recent().Mean(ring_, scale_);
    }

private:
    void Observe(const Swarm &swarm)
    {
        if (!show_ || !progress_.IsDue(WallS()))
            return;
        states_.clear();
        for (const size_t robot : ring_.order)
            states_.push_back(swarm.State(static_cast<int>(robot)));
        progress_.Show(swarm.TimeS(), duration_s_, WallS(), Measure(states_, ring_.size, scale_));
    }

    void KeepPace(double t_s)
    {
        if (realtime_factor_ > 0)
            std::this_thread::sleep_until(begin_ + ToClock(t_s / realtime_factor_));
    }

    static Clock::duration ToClock(double duration_s)
    {
        return std::chrono::duration_cast<Clock::duration>(
            std::chrono::duration<double>(duration_s));
    }

    Bounds bounds_;
    Clock::time_point begin_ = Clock::now();
    std::optional<double> duration_s_;
    double realtime_factor_;
    Ring ring_;
    MetricScale scale_;
    bool show_;
    std::vector<RobotState> states_;
    Progress progress_;
};

}  // namespace

void RequestStop()
{
    g_stop = 1;
}

void Run(const Options &options)
{
    CheckOutputs(options);
    const Setup setup = Prepare(options);
    std::shared_ptr<const Script> script;
    if (!options.script.empty())
        script = std::make_shared<Script>(Script::Load(options.script));
    std::optional<double> duration_s = options.duration_s;
    if (script && !duration_s)
        duration_s = script->EndS();
    const double realtime_factor =
        options.realtime_factor.value_or(duration_s && !options.UsesBus() ? 0 : 1);

    std::vector<Publisher::Robot> described = DescribeRobots(options, setup);

    for (const Inert &number : setup.model.InertIn(options.plant))
        std::fprintf(stderr, "twin_run: %s does nothing here: %s\n", number.name.c_str(),
                     number.why.c_str());
    Swarm swarm = MakeSwarm(options, setup, script);
    Outlet outlet;
    const bool on_bus = OpenOutlet(options, outlet);
    PrintHeader(options, swarm, on_bus, realtime_factor);
    Publisher publisher(outlet, swarm, setup.robots, std::move(described), options.channel_prefix,
                        options.pose_rate_hz, options.seed);
    Pictures pictures(options);
    Views views(MakeViewOptions(options, setup.robots, pictures));
    Loop loop(options, setup, duration_s, realtime_factor);
    Commands commands(outlet, swarm, publisher, script,
                      {options.channel_prefix, options.script_dir, options.wait,
                       on_bus ? LoadKey(options.key) : seal_key{}, setup.own.All()});
    loop.Turn(swarm, publisher, commands, views);
    const double wall_s = loop.WallS();
    views.Finish(swarm);
    pictures.Finish();
    outlet.Finish();
    PrintSummary(options, {setup.command_line, swarm.Size(), swarm.PeriodS(), swarm.TimeS(), wall_s,
                           g_stop != 0, loop.Mean(publisher)});
}

}  // namespace twin

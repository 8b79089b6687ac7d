// SPDX-License-Identifier: Apache-2.0
#include "sweep/worlds.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string_view>

#include "fw/config.h"
#include "swarm/bodies.h"
#include "swarm/bounds.h"
#include "swarm/robots.h"
#include "swarm/swarm.h"
#include "sweep/batch.h"
#include "sweep/defence.h"

namespace twin
{
namespace
{

Swarm MakeSwarm(const World &world, const PlantMaker &make)
{
    const Cell &cell = *world.cell;
    const int n = static_cast<int>(cell.tables.size());
    const auto robots = DrawRobots(cell.model, n, world.seed);
    const auto starts = StartsOf(cell, world.seed);
    return Swarm(make(robots, starts, world.seed, cell.world), robots, cell.tables,
                 {.seed = world.seed, .colours = cell.colours, .world = cell.world});
}

// The classes that a swarm goes through.
class History
{
public:
    void Add(double t_s, const Metrics &now)
    {
        recent_.Add(t_s, now);
        if (t_s < next_s_)
            return;
        classes_.emplace_back(t_s, Classify(recent_.Mean()));
        next_s_ += kEvery_s;
    }
    double SettledIn(std::string_view last) const
    {
        double since_s = std::numeric_limits<double>::quiet_NaN();
        for (auto at = classes_.rbegin(); at != classes_.rend() && at->second == last; ++at)
            since_s = std::max(0.0, at->first - kWindow_s);
        return since_s;
    }

private:
    static constexpr double kWindow_s = 5, kEvery_s = 1;
    MetricWindow recent_{kWindow_s};
    double next_s_ = kWindow_s;
    std::vector<std::pair<double, std::string_view>> classes_;
};

Outcome RunFull(const World &world, double duration_s, const PlantMaker &make)
{
    const Cell &cell = *world.cell;
    const MetricScale scale{cell.model.sensor.range_m, cell.model.robot.body_radius_m};
    Swarm swarm = MakeSwarm(world, make);
    const StepCount count = CountSteps(swarm.PeriodS(), duration_s);
    MetricWindow window(std::numeric_limits<double>::infinity());
    History history;
    Bounds bounds;
    DefenceWatch defence(cell);
    Outcome outcome{{}, std::numeric_limits<double>::infinity()};
    std::vector<RobotState> states(cell.tables.size());
    for (int step = 0; step < count.steps; ++step)
    {
        swarm.Step();
        bounds.Check(swarm);
        defence.Add(swarm);
        if (!count.Samples(step))
            continue;
        for (size_t i = 0; i < states.size(); ++i)
            states[i] = swarm.State(static_cast<int>(i));
        const Metrics now = Measure(states, cell.ring_size, scale);
        history.Add(swarm.TimeS(), now);
        if (!count.Measures(step))
            continue;
        window.Add(swarm.TimeS(), now);
        outcome.least_diffusion = std::min(outcome.least_diffusion, now.diffusion);
    }
    outcome.mean = window.Mean();
    outcome.defence = defence.Sum();
    outcome.settled_s = history.SettledIn(Classify(outcome.mean));
    return outcome;
}

// How many of the first worlds make one batch of the batched kernel.
size_t BatchSize(std::span<const World> worlds)
{
    size_t size = 1;
    const size_t most = std::min(worlds.size(), BatchWidths().front().lanes);
    while (size < most && (worlds[size].cell == worlds[0].cell ||
                           (WhyNotBatched(worlds[size].cell->model).empty() &&
                            SameBatch(*worlds[size].cell, *worlds[0].cell))))
        ++size;
    return size;
}

}  // namespace

std::unique_ptr<Plant> MakePlanarBodies(const std::vector<Model> &models,
                                        const std::vector<Pose2> &starts, uint64_t seed,
                                        const std::vector<WorldBody> &world)
{
    return std::make_unique<PlanarBodies>(models, starts, seed, kGridPays, world);
}

std::vector<Outcome> RunWorlds(std::span<const World> worlds, double duration_s, Path path)
{
    std::vector<Outcome> outcomes(worlds.size());
    for (size_t done = 0; done < worlds.size();)
    {
        const World &world = worlds[done];
        size_t size = 1;
        if (path == Path::kFull || !WhyNotBatched(world.cell->model).empty())
            outcomes[done] = RunFull(world, duration_s, MakePlanarBodies);
        else
        {
            size = BatchSize(worlds.subspan(done));
            RunBatch(BatchWidths().front(), worlds.subspan(done, size), duration_s,
                     std::span(outcomes).subspan(done, size));
        }
        done += size;
    }
    return outcomes;
}

std::vector<Outcome> RunWorldsIn(const PlantMaker &make, std::span<const World> worlds,
                                 double duration_s)
{
    std::vector<Outcome> outcomes;
    for (const World &world : worlds)
        outcomes.push_back(RunFull(world, duration_s, make));
    return outcomes;
}

std::vector<std::vector<Pose2>> TraceWorld(const PlantMaker &make, const World &world,
                                           double duration_s, double every_s)
{
    Swarm swarm = MakeSwarm(world, make);
    const int steps = CountSteps(swarm.PeriodS(), duration_s).steps;
    const int stride = std::max(1, static_cast<int>(std::lround(every_s / swarm.PeriodS())));
    std::vector<std::vector<Pose2>> trace;
    for (int step = 0; step <= steps; ++step)
    {
        if (step % stride == 0)
        {
            trace.emplace_back();
            for (int i = 0; i < swarm.Size(); ++i)
                trace.back().push_back(swarm.State(i).pose);
        }
        swarm.Step();
    }
    return trace;
}

}  // namespace twin

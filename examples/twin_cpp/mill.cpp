// SPDX-License-Identifier: Apache-2.0
// Do eight robots of a model mill? mill MODEL.toml (as paper.toml) prints their circliness.
#include <cstdio>
#include <exception>

#include "swarm/bodies.h"
#include "swarm/metrics.h"
#include "swarm/robots.h"
#include "swarm/starts.h"
#include "swarm/swarm.h"

int main(int argc, char **argv)
try
{
    constexpr int kRobots = 8;
    constexpr uint64_t kSeed = 1;
    const auto model = twin::Model::Load(argc > 1 ? argv[1] : "paper.toml");
    const auto robots = twin::DrawRobots(model, kRobots, kSeed);
    const auto starts = twin::StartPoses(twin::StartShape::kFacingOut, kRobots, 0, 0, kSeed);
    const std::vector<fw_table> tables(kRobots, fw_behavior_find("milling")->table);
    twin::Swarm swarm(std::make_unique<twin::PlanarBodies>(robots, starts, kSeed), robots, tables,
                      {.seed = kSeed});
    twin::MetricWindow last_10_s(10);
    while (swarm.TimeS() < 120)
    {
        swarm.Step();
        std::vector<twin::RobotState> states;
        for (int robot = 0; robot < swarm.Size(); ++robot)
            states.push_back(swarm.State(robot));
        last_10_s.Add(swarm.TimeS(), twin::Measure(states, kRobots,
                                                   {.range_m = model.sensor.range_m,
                                                    .body_radius_m = model.robot.body_radius_m}));
    }
    const twin::Metrics mean = last_10_s.Mean();
    std::printf("circliness %.4f, radius %.3f m: %s\n", mean.circliness, mean.radius_m,
                twin::Classify(mean));
}
catch (const std::exception &error)
{
    std::fprintf(stderr, "mill: %s\n", error.what());
    return 1;
}

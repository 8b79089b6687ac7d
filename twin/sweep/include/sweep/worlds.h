// SPDX-License-Identifier: Apache-2.0
// Many swarms, each to its end: what phase diagrams are made of.
#ifndef SWEEP_WORLDS_H
#define SWEEP_WORLDS_H

#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "fw/table.h"
#include "model_file/model.h"
#include "plant/plant.h"
#include "swarm/metrics.h"
#include "swarm/starts.h"

namespace twin
{

// A swarm but for its seed.
struct Cell
{
    Model model;
    std::vector<fw_table> tables;  // one per robot; those after the first `ring_size` are odd
    size_t ring_size;
    StartShape start = StartShape::kSquare;
    double spread_m = 1.2;
    std::vector<Pose2> poses = {};  // where they start whatever the seed; empty: drawn
};

// Where the robots of a world start.
std::vector<Pose2> StartsOf(const Cell &cell, uint64_t seed);

struct World
{
    const Cell *cell;
    uint64_t seed;
};

struct Outcome
{
    Metrics mean;                // over the last 10 s, every 0.1 s or a little more often
    double least_diffusion = 0;  // of the same samples
    // Since when the swarm has been of the class that it ends in, by means over 5 s, once a second.
    // NaN: the last 5 s are of another class than the last 10 s, or the lean kernel ran.
    double settled_s = std::numeric_limits<double>::quiet_NaN();
};

enum class Path
{
    kBest,  // lean where it serves, else full
    kFull,  // every robot its firmware, its effects and its plant
};

// The plant of a swarm: one model and one start a robot, and the seed of its noise.
using PlantMaker = std::function<std::unique_ptr<Plant>(
    const std::vector<Model> &models, const std::vector<Pose2> &starts, uint64_t seed)>;
std::unique_ptr<Plant> MakePlanarBodies(const std::vector<Model> &models,
                                        const std::vector<Pose2> &starts, uint64_t seed);

// Why the lean kernel cannot run this model: effects, lag, noise, a delay near the firmware's
// time-out. Empty if it can.
std::string WhyNotLean(const Model &model);

// Runs each world for `duration_s`; outcomes in the same order. They depend on nothing but the
// world and the duration. Throws std::invalid_argument in one sentence if a swarm cannot be made.
std::vector<Outcome> RunWorlds(std::span<const World> worlds, double duration_s, Path path);

// The same in another plant, by the full path.
std::vector<Outcome> RunWorldsIn(const PlantMaker &make, std::span<const World> worlds,
                                 double duration_s);

// Poses of one world by the full path, every `every_s`, the start first: robots within times.
std::vector<std::vector<Pose2>> TraceWorld(const World &world, double duration_s, double every_s);

}  // namespace twin

#endif

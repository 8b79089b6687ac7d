// SPDX-License-Identifier: Apache-2.0
// Many swarms, each to its end: what phase diagrams are made of.
#ifndef SWEEP_WORLDS_H
#define SWEEP_WORLDS_H

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "model_file/model.h"
#include "plant/plant.h"
#include "sweep/cell.h"

namespace twin
{

enum class Path
{
    kBest,  // batched where it serves, else full
    kFull,  // every robot its firmware, its effects and its plant
};

// The plant of a swarm: one model and one start a robot, the seed of its noise, and what else is
// there.
using PlantMaker = std::function<std::unique_ptr<Plant>(
    const std::vector<Model> &models, const std::vector<Pose2> &starts, uint64_t seed,
    const std::vector<WorldBody> &world)>;
std::unique_ptr<Plant> MakePlanarBodies(const std::vector<Model> &models,
                                        const std::vector<Pose2> &starts, uint64_t seed,
                                        const std::vector<WorldBody> &world = {});

// Runs each world for `duration_s`; outcomes in the same order. They depend on nothing but the
// world and the duration. Throws std::invalid_argument in one sentence if a swarm cannot be made,
// or is out of bounds.
std::vector<Outcome> RunWorlds(std::span<const World> worlds, double duration_s, Path path);

// The same in another plant, by the full path.
std::vector<Outcome> RunWorldsIn(const PlantMaker &make, std::span<const World> worlds,
                                 double duration_s);

// Poses of one world by the full path, every `every_s`, the start first: robots within times.
std::vector<std::vector<Pose2>> TraceWorld(const PlantMaker &make, const World &world,
                                           double duration_s, double every_s);

}  // namespace twin

#endif

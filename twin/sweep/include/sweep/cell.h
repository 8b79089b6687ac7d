// SPDX-License-Identifier: Apache-2.0
// What a sweep is made of: swarms, and how they end.
#ifndef SWEEP_CELL_H
#define SWEEP_CELL_H

#include <limits>
#include <vector>

#include "fw/table.h"
#include "model_file/model.h"
#include "plant/plant.h"
#include "sensor/scene.h"
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
    std::vector<Pose2> poses = {};      // where they start whatever the seed; empty: drawn
    std::vector<Colour> colours = {};   // of the robots' targets; empty: TargetColour()
    std::vector<WorldBody> world = {};  // what else there is to see and to run into

    Colour ColourOf(size_t robot) const
    {
        return colours.empty() ? TargetColour() : colours[robot];
    }
};

// Where the robots of a world start.
std::vector<Pose2> StartsOf(const Cell &cell, uint64_t seed);

struct World
{
    const Cell *cell;
    uint64_t seed;
};

// Evaders are solid bodies of the world that move, and robots whose target has another colour than
// the first's; goals are bodies that are not solid. Of the whole run, by the poses at the end of
// each control period.
struct Defence
{
    // When a robot of the first one's colour first touches an evader; NaN: never.
    double caught_s = std::numeric_limits<double>::quiet_NaN();
    // When the middle of an evader that was not caught before is first in a goal; NaN: never.
    double reached_s = std::numeric_limits<double>::quiet_NaN();
    double inside = 0;  // share of the run for which an evader is in a goal
};

struct Outcome
{
    Metrics mean;                // over the last 10 s, every 0.1 s or a little more often
    double least_diffusion = 0;  // of the same samples
    // Since when the swarm has been of the class that it ends in, by means over 5 s, once a second.
    // NaN: the last 5 s are of another class than the last 10 s, or the batched kernel ran.
    double settled_s = std::numeric_limits<double>::quiet_NaN();
    Defence defence{};  // of cells with a world
};

}  // namespace twin

#endif

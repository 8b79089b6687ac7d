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
    std::vector<Pose2> poses = {};     // where they start whatever the seed; empty: drawn
    std::vector<Colour> colours = {};  // of the robots' targets; empty: TargetColour()

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

struct Outcome
{
    Metrics mean;                // over the last 10 s, every 0.1 s or a little more often
    double least_diffusion = 0;  // of the same samples
    // Since when the swarm has been of the class that it ends in, by means over 5 s, once a second.
    // NaN: the last 5 s are of another class than the last 10 s, or the batched kernel ran.
    double settled_s = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace twin

#endif

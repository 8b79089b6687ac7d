// SPDX-License-Identifier: Apache-2.0
// Who is near: poses in square cells, so that large swarms need not try all pairs.
#ifndef SWARM_CELL_GRID_H
#define SWARM_CELL_GRID_H

#include <span>
#include <vector>

#include "plant/plant.h"

namespace twin
{

// From this many robots on a grid is faster than trying all pairs (benchmarks/README.md).
constexpr size_t kGridPays = 400;

class CellGrid
{
public:
    // Sorts poses into cells of at least `reach_m`. Keeps its memory from call to call.
    void Fill(std::span<const Pose2> poses, double reach_m);

    // Indices, ascending, of all poses within reach_m of pose `index`, itself and some that are
    // farther included.
    const std::vector<size_t> &Near(size_t index);

private:
    struct Place
    {
        size_t column, row;
    };
    size_t At(const Place &place) const { return place.row * columns_ + place.column; }

    size_t columns_ = 1, rows_ = 1;
    std::vector<Place> places_;   // of each pose
    std::vector<size_t> begins_;  // of each cell's poses in order_, and the end of the last
    std::vector<size_t> order_, near_;
};

}  // namespace twin

#endif

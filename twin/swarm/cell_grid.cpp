// SPDX-License-Identifier: Apache-2.0
#include "swarm/cell_grid.h"

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace twin
{
namespace
{

// Cells beyond this many for each pose only cost memory.
constexpr double kCellsPerPose = 4;
// Cells a little larger than the reach: rounding never puts neighbours two cells apart.
constexpr double kRounding = 1 + 1e-9;

struct Box
{
    double x_m, y_m, width_m, height_m;
};

Box Around(std::span<const Pose2> poses)
{
    const auto [left, right] = std::ranges::minmax(poses, {}, &Pose2::x_m);
    const auto [low, high] = std::ranges::minmax(poses, {}, &Pose2::y_m);
    return {left.x_m, low.y_m, right.x_m - left.x_m, high.y_m - low.y_m};
}

// 0 for what is not a number.
size_t Index(double cells, size_t count)
{
    return cells > 0 ? std::min(static_cast<size_t>(cells), count - 1) : 0;
}

}  // namespace

void CellGrid::Fill(std::span<const Pose2> poses, double reach_m)
{
    const Box box = Around(poses);
    const double most = kCellsPerPose * static_cast<double>(poses.size());
    double cell_m = reach_m * kRounding;
    while ((box.width_m / cell_m + 1) * (box.height_m / cell_m + 1) > most + 1)
        cell_m *= 2;
    columns_ = Index(box.width_m / cell_m, SIZE_MAX) + 1;
    rows_ = Index(box.height_m / cell_m, SIZE_MAX) + 1;
    places_.clear();
    begins_.assign(columns_ * rows_ + 1, 0);
    for (const Pose2 &pose : poses)
    {
        places_.push_back({Index((pose.x_m - box.x_m) / cell_m, columns_),
                           Index((pose.y_m - box.y_m) / cell_m, rows_)});
        ++begins_[At(places_.back()) + 1];
    }
    std::partial_sum(begins_.begin(), begins_.end(), begins_.begin());
    order_.resize(poses.size());
    std::vector<size_t> &next = near_;
    next.assign(begins_.begin(), begins_.end() - 1);
    for (size_t i = 0; i < poses.size(); ++i)
        order_[next[At(places_[i])]++] = i;
}

const std::vector<size_t> &CellGrid::Near(size_t index)
{
    near_.clear();
    const Place here = places_[index];
    const size_t last_row = std::min(here.row + 1, rows_ - 1);
    const size_t first = here.column - (here.column > 0);
    const size_t last = std::min(here.column + 1, columns_ - 1);
    for (size_t row = here.row - (here.row > 0); row <= last_row; ++row)
        near_.insert(near_.end(),
                     order_.begin() + static_cast<std::ptrdiff_t>(begins_[At({first, row})]),
                     order_.begin() + static_cast<std::ptrdiff_t>(begins_[At({last, row}) + 1]));
    std::ranges::sort(near_);
    return near_;
}

}  // namespace twin

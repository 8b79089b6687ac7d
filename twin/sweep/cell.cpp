// SPDX-License-Identifier: Apache-2.0
#include "sweep/cell.h"

namespace twin
{

std::vector<Pose2> StartsOf(const Cell &cell, uint64_t seed)
{
    if (!cell.poses.empty())
        return cell.poses;
    return StartPoses(cell.start, static_cast<int>(cell.tables.size()), cell.spread_m,
                      cell.model.robot.body_radius_m, seed, cell.world);
}

}  // namespace twin

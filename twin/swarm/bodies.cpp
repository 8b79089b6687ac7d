// SPDX-License-Identifier: Apache-2.0
#include "swarm/bodies.h"

#include <cmath>

namespace twin
{

void PushApart(std::vector<Pose2> &poses, double radius_m)
{
    const std::vector<Pose2> before = poses;
    const double touch_m = 2 * radius_m;
    for (size_t i = 0; i < before.size(); ++i)
        for (size_t j = i + 1; j < before.size(); ++j)
        {
            const double dx_m = before[j].x_m - before[i].x_m;
            const double dy_m = before[j].y_m - before[i].y_m;
            const double distance2 = dx_m * dx_m + dy_m * dy_m;
            if (!(distance2 < touch_m * touch_m) || distance2 == 0)
                continue;
            const double push = (touch_m / std::sqrt(distance2) - 1) / 2;
            poses[i].x_m -= push * dx_m;
            poses[i].y_m -= push * dy_m;
            poses[j].x_m += push * dx_m;
            poses[j].y_m += push * dy_m;
        }
}

PlanarBodies::PlanarBodies(const std::vector<Model> &models, const std::vector<Pose2> &starts,
                           uint64_t seed)
    : PlanarPlant(models, starts, seed),
      radius_m_(models.front().robot.body_radius_m),
      poses_(models.size())
{
}

void PlanarBodies::Step(double dt_s)
{
    PlanarPlant::Step(dt_s);
    if (radius_m_ == 0)
        return;
    for (int i = 0; i < Size(); ++i)
        poses_[static_cast<size_t>(i)] = State(i).pose;
    PushApart(poses_, radius_m_);
    for (int i = 0; i < Size(); ++i)
        Move(i, poses_[static_cast<size_t>(i)]);
}

}  // namespace twin

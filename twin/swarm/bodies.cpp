// SPDX-License-Identifier: Apache-2.0
#include "swarm/bodies.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace twin
{
namespace
{

struct Shift
{
    double x_m, y_m;
};

// From where `a` was to where it is.
Shift Moved(const Pose2 &a, const Pose2 &before)
{
    return {a.x_m - before.x_m, a.y_m - before.y_m};
}

// What friction takes back of the way that body j slid past body i along the tangent (-n_y, n_x).
Shift TakenBack(const Shift &i, const Shift &j, double n_x, double n_y, double most_m)
{
    const double slid_m = (j.y_m - i.y_m) * n_x - (j.x_m - i.x_m) * n_y;
    const double back_m = std::clamp(slid_m, -most_m, most_m);
    return {-n_y * back_m, n_x * back_m};
}

double Distance2(const Pose2 &i, const Pose2 &j)
{
    const double dx_m = j.x_m - i.x_m, dy_m = j.y_m - i.y_m;
    return dx_m * dx_m + dy_m * dy_m;
}

bool Touch(const Pose2 &i, const Pose2 &j, const Body &a, const Body &b)
{
    const double touch_m = a.radius_m + b.radius_m, distance2 = Distance2(i, j);
    return distance2 < touch_m * touch_m && distance2 != 0;
}

// How far body j, which touches body i, is pushed, and i the other way. `i_moved`, `j_moved`: since
// the step before.
Shift HalfPush(const Pose2 &i, const Pose2 &j, const Shift &i_moved, const Shift &j_moved,
               const Body &a, const Body &b)
{
    const double touch_m = a.radius_m + b.radius_m;
    const double dx_m = j.x_m - i.x_m, dy_m = j.y_m - i.y_m, distance2 = Distance2(i, j);
    const double push = (touch_m / std::sqrt(distance2) - 1) / 2;
    Shift half{push * dx_m, push * dy_m};
    const double friction = std::max(a.friction, b.friction);
    if (friction > 0)
    {
        const double distance_m = std::sqrt(distance2);
        const Shift back = TakenBack(i_moved, j_moved, dx_m / distance_m, dy_m / distance_m,
                                     friction * (touch_m - distance_m));
        half = {half.x_m - back.x_m / 2, half.y_m - back.y_m / 2};
    }
    return half;
}

}  // namespace

void PushApart(std::vector<Pose2> &poses, const std::vector<Pose2> &before,
               const std::vector<Body> &bodies, CellGrid *grid)
{
    const std::vector<Pose2> now = poses;
    const auto push = [&](size_t i, size_t j) {
        const Shift half = HalfPush(now[i], now[j], Moved(now[i], before[i]),
                                    Moved(now[j], before[j]), bodies[i], bodies[j]);
        poses[i].x_m -= half.x_m;
        poses[i].y_m -= half.y_m;
        poses[j].x_m += half.x_m;
        poses[j].y_m += half.y_m;
    };
    if (grid)
        grid->Fill(now, 2 * std::ranges::max(bodies, {}, &Body::radius_m).radius_m);
    for (size_t i = 0; i < now.size(); ++i)
        if (grid)
        {
            for (const size_t j : grid->Near(i))
                if (j > i && Touch(now[i], now[j], bodies[i], bodies[j]))
                    push(i, j);
        }
        else
            for (size_t j = i + 1; j < now.size(); ++j)
                if (Touch(now[i], now[j], bodies[i], bodies[j]))
                    push(i, j);
}

// As a push between two discs, of which one takes the whole of it: the robot, and the wall's disc
// that is nearest to it.
void PushOut(Pose2 &pose, const Pose2 &pose_before, const Body &body, const Capsule &wall,
             const Capsule &wall_before)
{
    const Eigen::Vector2d at_m = NearestPoint(wall, {pose.x_m, pose.y_m});
    const Eigen::Vector2d moved_m = wall.from_m - wall_before.from_m;
    const Pose2 nearest{at_m.x(), at_m.y(), 0};
    const Body still{wall.radius_m, 0};
    if (!Touch(pose, nearest, body, still))
        return;
    const Shift half =
        HalfPush(pose, nearest, Moved(pose, pose_before), {moved_m.x(), moved_m.y()}, body, still);
    pose.x_m -= 2 * half.x_m;
    pose.y_m -= 2 * half.y_m;
}

PlanarBodies::PlanarBodies(const std::vector<Model> &models, const std::vector<Pose2> &starts,
                           uint64_t seed, size_t grid_from, std::vector<WorldBody> world)
    : PlanarPlant(models, starts, seed),
      world_(std::move(world)),
      before_(models.size()),
      poses_(models.size()),
      grid_from_(grid_from)
{
    std::erase_if(world_, [](const WorldBody &body) { return !body.is_solid; });
    for (const Model &model : models)
        bodies_.push_back(model.MakeBody());
    touch_ = std::any_of(bodies_.begin(), bodies_.end(),
                         [](const Body &body) { return body.radius_m > 0; });
}

void PlanarBodies::Step(double dt_s)
{
    for (int i = 0; i < Size(); ++i)
        before_[static_cast<size_t>(i)] = State(i).pose;
    PlanarPlant::Step(dt_s);
    if (!touch_)
        return;
    for (int i = 0; i < Size(); ++i)
        poses_[static_cast<size_t>(i)] = State(i).pose;
    PushApart(poses_, before_, bodies_, poses_.size() >= grid_from_ ? &grid_ : nullptr);
    StopAtWorld(dt_s);
    for (int i = 0; i < Size(); ++i)
        Move(i, poses_[static_cast<size_t>(i)]);
}

void PlanarBodies::StopAtWorld(double dt_s)
{
    for (const WorldBody &body : world_)
    {
        const Capsule now = body.At(TimeS()), before = body.At(TimeS() - dt_s);
        for (size_t i = 0; i < poses_.size(); ++i)
            if (bodies_[i].radius_m > 0)
                PushOut(poses_[i], before_[i], bodies_[i], now, before);
    }
}

}  // namespace twin

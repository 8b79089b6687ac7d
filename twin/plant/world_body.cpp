// SPDX-License-Identifier: Apache-2.0
#include "plant/world_body.h"

#include <algorithm>
#include <cmath>

namespace twin
{
namespace
{

using Eigen::Vector2d;

// Twice the area of the triangle, positive if c is left of the way from a to b.
double Turn(const Vector2d &a, const Vector2d &b, const Vector2d &c)
{
    const Vector2d ab = b - a, ac = c - a;
    return ab.x() * ac.y() - ab.y() * ac.x();
}

bool Intersect(const Vector2d &a, const Vector2d &b, const Vector2d &c, const Vector2d &d)
{
    return Turn(a, b, c) * Turn(a, b, d) < 0 && Turn(c, d, a) * Turn(c, d, b) < 0;
}

}  // namespace

Vector2d NearestPoint(const Capsule &capsule, const Vector2d &point_m)
{
    const Vector2d along = capsule.to_m - capsule.from_m;
    const double length2 = along.squaredNorm();
    const double part = length2 > 0 ? along.dot(point_m - capsule.from_m) / length2 : 0;
    return capsule.from_m + std::clamp(part, 0.0, 1.0) * along;
}

// Two segments that do not cross are nearest at an end of one of them.
bool Crosses(const Capsule &capsule, const Vector2d &a_m, const Vector2d &b_m)
{
    if (Intersect(capsule.from_m, capsule.to_m, a_m, b_m))
        return true;
    const Capsule way{a_m, b_m, 0};
    const double apart_m = std::min({(NearestPoint(capsule, a_m) - a_m).norm(),
                                     (NearestPoint(capsule, b_m) - b_m).norm(),
                                     (NearestPoint(way, capsule.from_m) - capsule.from_m).norm(),
                                     (NearestPoint(way, capsule.to_m) - capsule.to_m).norm()});
    return apart_m < capsule.radius_m;
}

Capsule WorldBody::At(double t_s) const
{
    Vector2d at_m = shape.from_m;
    double loop_m = 0;
    for (size_t i = 0; i <= path_m.size(); ++i)
    {
        const Vector2d &next_m = i < path_m.size() ? path_m[i] : shape.from_m;
        loop_m += (next_m - at_m).norm();
        at_m = next_m;
    }
    double left_m = loop_m > 0 ? std::fmod(speed_mps * t_s, loop_m) : 0;
    for (size_t i = 0; left_m > 0 && i <= path_m.size(); ++i)
    {
        const Vector2d way = (i < path_m.size() ? path_m[i] : shape.from_m) - at_m;
        const double gone_m = std::min(left_m, way.norm());
        if (gone_m > 0)
            at_m += gone_m * way.normalized();
        left_m -= gone_m;
    }
    return {at_m, at_m + shape.to_m - shape.from_m, shape.radius_m};
}

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "plant/world_body.h"

#include <algorithm>
#include <cmath>

namespace twin
{
namespace
{

using Eigen::Vector2d;

using One = CapsuleFormulas<1>;

One::Point PointOf(const Vector2d &point_m)
{
    return {Lanes<1>::All(point_m.x()), Lanes<1>::All(point_m.y())};
}

}  // namespace

PlainCapsule PlainOf(const Capsule &capsule)
{
    return {capsule.from_m.x(), capsule.from_m.y(), capsule.to_m.x(), capsule.to_m.y(),
            capsule.radius_m};
}

Vector2d NearestPoint(const Capsule &capsule, const Vector2d &point_m)
{
    const One::Point nearest =
        One::Nearest(PointOf(capsule.from_m), PointOf(capsule.to_m), PointOf(point_m));
    return {nearest.x_m[0], nearest.y_m[0]};
}

bool Crosses(const Capsule &capsule, const Vector2d &a_m, const Vector2d &b_m)
{
    return One::Crosses(PlainOf(capsule), PointOf(a_m), PointOf(b_m))[0];
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

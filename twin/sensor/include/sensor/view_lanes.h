// SPDX-License-Identifier: Apache-2.0
// Bodies before a camera, for one world or for one in each vector lane. See plant/lanes.h on what
// may be included.
#ifndef SENSOR_VIEW_LANES_H
#define SENSOR_VIEW_LANES_H

#include "plant/capsule_lanes.h"

namespace twin
{

// Where a camera is, where it looks, and how far: `half_...` of half of its cone.
template <int W>
struct EyeLanes
{
    PointLanes<W> at;
    typename Lanes<W>::Real axis_cos, axis_sin, half_cos, half_sin, range_m;
};

template <int W>
struct ViewFormulas
{
    using L = Lanes<W>;
    using C = CapsuleFormulas<W>;
    using Real = typename L::Real;
    using Mask = typename L::Mask;
    using Point = PointLanes<W>;
    using Eye = EyeLanes<W>;

    // How far a point is from the field of view; 0 within.
    static Real ToView(const Eye &eye, const Point &point)
    {
        const Real dx = point.x_m - eye.at.x_m, dy = point.y_m - eye.at.y_m;
        const Real ahead = eye.axis_cos * dx + eye.axis_sin * dy;
        const Real aside = L::Abs(eye.axis_cos * dy - eye.axis_sin * dx);
        const Real distance = L::Sqrt(ahead * ahead + aside * aside);
        const Real beyond = L::Max(distance - eye.range_m, Real{});
        const Real along =
            L::Min(L::Max(ahead * eye.half_cos + aside * eye.half_sin, Real{}), eye.range_m);
        const Real over = ahead - along * eye.half_cos, off = aside - along * eye.half_sin;
        return ahead >= eye.half_cos * distance ? beyond : L::Sqrt(over * over + off * off);
    }

    struct Part
    {
        Mask in_view;
        Point at;  // of the segment
    };

    // The point of the body's segment from which its nearest part is in view. The distance to a
    // convex set is convex along a segment: golden sections find its least.
    static Part PartInView(const Eye &eye, const PlainCapsule &body)
    {
        const Point from = C::From(body);
        const Real reach = eye.range_m + body.radius_m;
        const Mask near = C::Distance2(body, eye.at) < reach * reach;
        if (!L::Any(near))
            return {near, from};
        const double x_m = body.to_x_m - body.from_x_m, y_m = body.to_y_m - body.from_y_m;
        const auto at = [&](Real part) {
            return Point{from.x_m + part * x_m, from.y_m + part * y_m};
        };
        Real low{}, high{};
        if (x_m != 0 || y_m != 0)
        {
            high = L::All(1);
            for (int i = 0; i < kGoldenSteps; ++i)
            {
                const Real step = (high - low) / kPhi, left = high - step, right = low + step;
                const Mask is_left = ToView(eye, at(left)) <= ToView(eye, at(right));
                high = is_left ? right : high;
                low = is_left ? low : left;
            }
        }
        const Point found = at((low + high) / 2);
        return {near & (ToView(eye, found) < body.radius_m), found};
    }

private:
    static constexpr double kPhi = 1.618033988749894848;
    static constexpr int kGoldenSteps = 40;  // shrink a wall of 100 m to less than a micrometre
};

}  // namespace twin

#endif

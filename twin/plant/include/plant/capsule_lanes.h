// SPDX-License-Identifier: Apache-2.0
// The geometry of world_body.h, for one world or for one in each vector lane. See lanes.h on what
// may be included.
#ifndef PLANT_CAPSULE_LANES_H
#define PLANT_CAPSULE_LANES_H

#include "plant/lanes.h"

namespace twin
{

// A Capsule as plain numbers, the same in all lanes.
struct PlainCapsule
{
    double from_x_m, from_y_m, to_x_m, to_y_m, radius_m;
};

template <int W>
struct PointLanes
{
    typename Lanes<W>::Real x_m, y_m;
};

template <int W>
struct CapsuleFormulas
{
    using L = Lanes<W>;
    using Real = typename L::Real;
    using Mask = typename L::Mask;
    using Point = PointLanes<W>;

    static Point From(const PlainCapsule &c) { return {L::All(c.from_x_m), L::All(c.from_y_m)}; }
    static Point To(const PlainCapsule &c) { return {L::All(c.to_x_m), L::All(c.to_y_m)}; }

    // The point of the way from `a` to `b` that is nearest to `point`.
    static Point Nearest(const Point &a, const Point &b, const Point &point)
    {
        const Real x = b.x_m - a.x_m, y = b.y_m - a.y_m, length2 = x * x + y * y;
        const Real along = x * (point.x_m - a.x_m) + y * (point.y_m - a.y_m);
        const Real part = length2 > 0 ? along / length2 : Real{};
        const Real within = L::Min(L::Max(part, Real{}), L::All(1));
        return {a.x_m + within * x, a.y_m + within * y};
    }

    // Of the way's nearest point from `point`, squared.
    static Real Distance2(const Point &a, const Point &b, const Point &point)
    {
        const Point nearest = Nearest(a, b, point);
        const Real x = point.x_m - nearest.x_m, y = point.y_m - nearest.y_m;
        return x * x + y * y;
    }
    static Real Distance2(const PlainCapsule &c, const Point &point)
    {
        return Distance2(From(c), To(c), point);
    }

    // Whether the way from `a` to `b` goes through the capsule. Two segments that do not cross are
    // nearest at an end of one of them.
    static Mask Crosses(const PlainCapsule &c, const Point &a, const Point &b)
    {
        const Point from = From(c), to = To(c);
        const Mask meet =
            (Turn(from, to, a) * Turn(from, to, b) < 0) & (Turn(a, b, from) * Turn(a, b, to) < 0);
        const Real apart2 = L::Min(L::Min(Distance2(from, to, a), Distance2(from, to, b)),
                                   L::Min(Distance2(a, b, from), Distance2(a, b, to)));
        return meet | (apart2 < c.radius_m * c.radius_m);
    }

private:
    // Twice the area of the triangle, positive if `c` is left of the way from `a` to `b`.
    static Real Turn(const Point &a, const Point &b, const Point &c)
    {
        return (b.x_m - a.x_m) * (c.y_m - a.y_m) - (b.y_m - a.y_m) * (c.x_m - a.x_m);
    }
};

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// Whether evaders are kept out of goals, for one world or for one in each vector lane. See
// plant/lanes.h on what may be included.
#ifndef SWEEP_DEFENCE_LANES_H
#define SWEEP_DEFENCE_LANES_H

#include "plant/capsule_lanes.h"

namespace twin
{

// A body of the world, but for where it is.
struct PlainBody
{
    bool is_solid;
    bool is_evader;  // solid, and it moves; what is not solid is a goal
};

// What all lanes share.
struct DefenceWorld
{
    int n, body_count;
    const PlainBody *bodies;
    const uint8_t *is_foe;  // of each robot; foes are evaders, too
    double robot_m;         // radius
    double touch;  // how many times their radii the middles of two that touch are apart at most
};

template <int W>
struct DefenceLanes
{
    typename Lanes<W>::Real caught_s, reached_s;  // infinite: never
    typename Lanes<W>::Real inside;               // steps
};

template <int W>
struct DefenceFormulas
{
    using L = Lanes<W>;
    using C = CapsuleFormulas<W>;
    using Real = typename L::Real;
    using Mask = typename L::Mask;
    using Point = PointLanes<W>;

    // Adds a step that ended at `t_s`, with bodies at `places` and robots at x and y. `caught`: of
    // each body and then of each robot, whether one that is no foe has touched it so far.
    static void Add(const DefenceWorld &world, const PlainCapsule *places, const Real *x,
                    const Real *y, double t_s, Mask *caught, DefenceLanes<W> &sums)
    {
        const Real now = L::All(t_s), never = L::All(__builtin_inf());
        Mask inside{};
        for (int e = 0; e < world.body_count + world.n; ++e)
        {
            const int robot = e - world.body_count;
            const bool is_body = robot < 0;
            if (is_body ? !world.bodies[e].is_evader : !world.is_foe[robot])
                continue;
            const Mask touched = is_body ? Touched(world, places[e], x, y)
                                         : Touched(world, {x[robot], y[robot]}, x, y);
            const Mask in_goal =
                InGoal(world, places, is_body ? Middle(places[e]) : Point{x[robot], y[robot]});
            caught[e] |= touched;
            inside |= in_goal;
            sums.caught_s = L::Min(sums.caught_s, touched ? now : never);
            sums.reached_s = L::Min(sums.reached_s, in_goal & ~caught[e] ? now : never);
        }
        sums.inside += L::One(inside);
    }

private:
    static Point Middle(const PlainCapsule &c)
    {
        return {L::All((c.from_x_m + c.to_x_m) / 2), L::All((c.from_y_m + c.to_y_m) / 2)};
    }

    static Mask Touched(const DefenceWorld &world, const PlainCapsule &body, const Real *x,
                        const Real *y)
    {
        const double touch_m = world.touch * (world.robot_m + body.radius_m);
        Mask touched{};
        for (int i = 0; i < world.n; ++i)
            if (!world.is_foe[i])
                touched |= C::Distance2(body, {x[i], y[i]}) < touch_m * touch_m;
        return touched;
    }

    static Mask Touched(const DefenceWorld &world, const Point &foe, const Real *x, const Real *y)
    {
        const double touch_m = world.touch * 2 * world.robot_m;
        Mask touched{};
        for (int i = 0; i < world.n; ++i)
        {
            if (world.is_foe[i])
                continue;
            const Real dx = x[i] - foe.x_m, dy = y[i] - foe.y_m;
            touched |= dx * dx + dy * dy < touch_m * touch_m;
        }
        return touched;
    }

    // Whether a point is in a body that is not solid.
    static Mask InGoal(const DefenceWorld &world, const PlainCapsule *places, const Point &point)
    {
        Mask inside{};
        for (int b = 0; b < world.body_count; ++b)
            if (!world.bodies[b].is_solid)
                inside |= C::Distance2(places[b], point) < places[b].radius_m * places[b].radius_m;
        return inside;
    }
};

}  // namespace twin

#endif

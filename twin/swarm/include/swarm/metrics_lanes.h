// SPDX-License-Identifier: Apache-2.0
// The formulas of metrics.h, for one world or for one in each vector lane.
#ifndef SWARM_METRICS_LANES_H
#define SWARM_METRICS_LANES_H

#include "plant/lanes.h"

namespace twin
{

// How a robot moves, in its own frame: the unit vector of its travel (0 if it stands) and where the
// centre of its turn is (0 if it does not turn), ahead and left each.
enum MotionColumn
{
    kTravelX,
    kTravelY,
    kTurnX,
    kTurnY,
    kMotion,
};

// Arrays of n robots; `motion`: kMotion of them in turn. Scratch: centre_x, centre_y, label.
template <int W>
struct SwarmLanes
{
    using Real = typename Lanes<W>::Real;
    int n, ring;
    const Real *x_m, *y_m, *cos_theta, *sin_theta;
    const Real *motion;
    Real *centre_x_m, *centre_y_m, *label;
    Real range_m;
    double touch_m;  // bodies whose centres are nearer touch
};

template <int W>
struct MetricLanes
{
    typename Lanes<W>::Real circliness, radius_m, scatter_m2, rotation, odd_ratio, diffusion,
        groups, contacts;
};

template <int W>
struct MetricFormulas
{
    using L = Lanes<W>;
    using Real = typename L::Real;
    using Mask = typename L::Mask;

    static Real Norm(Real x, Real y) { return L::Sqrt(x * x + y * y); }

    // About the centroid of the first `ring` robots.
    static void Ring(const SwarmLanes<W> &s, MetricLanes<W> &m)
    {
        const double n = s.ring;
        Real mean_x{}, mean_y{}, least = L::All(__builtin_inf()), most{};
        for (int i = 0; i < s.ring; ++i)
        {
            mean_x += s.x_m[i];
            mean_y += s.y_m[i];
        }
        mean_x /= n;
        mean_y /= n;
        for (int i = 0; i < s.ring; ++i)
        {
            const Real rx = s.x_m[i] - mean_x, ry = s.y_m[i] - mean_y, r2 = rx * rx + ry * ry;
            const Real along = s.motion[kTravelX * s.n + i], left = s.motion[kTravelY * s.n + i];
            const Real ux = s.cos_theta[i] * along - s.sin_theta[i] * left;
            const Real uy = s.sin_theta[i] * along + s.cos_theta[i] * left;
            const Real r = L::Sqrt(r2);
            least = L::Min(least, r);
            most = L::Max(most, r);
            m.radius_m += r;
            m.scatter_m2 += r2;
            m.rotation += r > 0 ? (rx * uy - ry * ux) / r : L::All(0);
        }
        m.radius_m /= n;
        m.scatter_m2 /= n;
        m.rotation /= n;
        m.circliness = most > 0 ? (most - least) / least : L::All(__builtin_nan(""));
        if (s.ring == s.n)
            m.odd_ratio = L::All(__builtin_nan(""));
        for (int i = s.ring; i < s.n; ++i)
            m.odd_ratio += Norm(s.x_m[i] - mean_x, s.y_m[i] - mean_y) / m.radius_m / (s.n - s.ring);
    }

    static void Centres(const SwarmLanes<W> &s)
    {
        for (int i = 0; i < s.n; ++i)
        {
            const Real ahead = s.motion[kTurnX * s.n + i], left = s.motion[kTurnY * s.n + i];
            s.centre_x_m[i] = s.x_m[i] + s.cos_theta[i] * ahead - s.sin_theta[i] * left;
            s.centre_y_m[i] = s.y_m[i] + s.sin_theta[i] * ahead + s.cos_theta[i] * left;
        }
    }

    // Gives the group of robot j the label of robot i's, in the lanes of the mask.
    static void Join(const SwarmLanes<W> &s, Mask lanes, int i, int j)
    {
        const Real kept = s.label[i], dropped = s.label[j];
        for (int k = 0; k < s.n; ++k)
            s.label[k] = lanes & (s.label[k] == dropped) ? kept : s.label[k];
    }

    static void Pairs(const SwarmLanes<W> &s, MetricLanes<W> &m)
    {
        Centres(s);
        for (int i = 0; i < s.n; ++i)
            s.label[i] = L::All(i);
        m.groups = L::All(s.n);
        const Real range2 = s.range_m * s.range_m;
        Real nearest2 = L::All(s.n > 1 ? __builtin_inf() : __builtin_nan(""));
        for (int i = 0; i < s.n; ++i)
            for (int j = i + 1; j < s.n; ++j)
            {
                const Real cx = s.centre_x_m[i] - s.centre_x_m[j];
                const Real cy = s.centre_y_m[i] - s.centre_y_m[j];
                const Real dx = s.x_m[i] - s.x_m[j], dy = s.y_m[i] - s.y_m[j];
                const Real distance2 = dx * dx + dy * dy;
                nearest2 = L::Min(nearest2, cx * cx + cy * cy);
                if (s.touch_m > 0)
                    m.contacts += L::One(distance2 < s.touch_m * s.touch_m);
                const Mask joins = (distance2 < range2) & (s.label[i] != s.label[j]);
                if (!L::Any(joins))
                    continue;
                m.groups -= L::One(joins);
                Join(s, joins, i, j);
            }
        m.diffusion = L::Sqrt(nearest2) / s.range_m;
    }

    static MetricLanes<W> Measure(const SwarmLanes<W> &s)
    {
        MetricLanes<W> m{};
        Ring(s, m);
        Pairs(s, m);
        return m;
    }
};

}  // namespace twin

#endif

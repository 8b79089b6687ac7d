// SPDX-License-Identifier: Apache-2.0
// The formulas of metrics.h, for one world or for one in each vector lane.
#ifndef SWARM_METRICS_LANES_H
#define SWARM_METRICS_LANES_H

#include "swarm/lanes.h"

namespace twin
{

// Arrays of n robots. Scratch: centre_x, centre_y, label.
template <int W>
struct SwarmLanes
{
    using Real = typename Lanes<W>::Real;
    int n, ring;
    const Real *x_m, *y_m, *cos_theta, *sin_theta;
    const Real *vx_mps, *vy_mps, *omega_radps;  // body frame
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
            const Real ux = s.cos_theta[i] * s.vx_mps[i] - s.sin_theta[i] * s.vy_mps[i];
            const Real uy = s.sin_theta[i] * s.vx_mps[i] + s.cos_theta[i] * s.vy_mps[i];
            const Real r = L::Sqrt(r2), ru = L::Sqrt(r2 * (ux * ux + uy * uy));
            least = L::Min(least, r);
            most = L::Max(most, r);
            m.radius_m += r;
            m.scatter_m2 += r2;
            m.rotation += ru > 0 ? (rx * uy - ry * ux) / ru : L::All(0);
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
            const Real ux = s.cos_theta[i] * s.vx_mps[i] - s.sin_theta[i] * s.vy_mps[i];
            const Real uy = s.sin_theta[i] * s.vx_mps[i] + s.cos_theta[i] * s.vy_mps[i];
            const Mask turns = s.omega_radps[i] != 0;
            s.centre_x_m[i] = turns ? s.x_m[i] - uy / s.omega_radps[i] : s.x_m[i];
            s.centre_y_m[i] = turns ? s.y_m[i] + ux / s.omega_radps[i] : s.y_m[i];
        }
    }

    // Robots in view range of each other take the smaller label until none changes: one label is
    // left for each group.
    static Real Groups(const SwarmLanes<W> &s)
    {
        for (int i = 0; i < s.n; ++i)
            s.label[i] = L::All(i);
        for (bool changed = true; changed;)
        {
            Mask moved{};
            for (int i = 0; i < s.n; ++i)
                for (int j = i + 1; j < s.n; ++j)
                {
                    const Mask near = Norm2(s, i, j) < s.range_m * s.range_m;
                    const Real least = L::Min(s.label[i], s.label[j]);
                    moved |= near & (s.label[i] != s.label[j]);
                    s.label[i] = near ? least : s.label[i];
                    s.label[j] = near ? least : s.label[j];
                }
            changed = L::Any(moved);
        }
        Real groups{};
        for (int i = 0; i < s.n; ++i)
            groups += L::One(s.label[i] == L::All(i));
        return groups;
    }

    static Real Norm2(const SwarmLanes<W> &s, int i, int j)
    {
        const Real dx = s.x_m[i] - s.x_m[j], dy = s.y_m[i] - s.y_m[j];
        return dx * dx + dy * dy;
    }

    static void Pairs(const SwarmLanes<W> &s, MetricLanes<W> &m)
    {
        Centres(s);
        Real nearest2 = L::All(s.n > 1 ? __builtin_inf() : __builtin_nan(""));
        for (int i = 0; i < s.n; ++i)
            for (int j = i + 1; j < s.n; ++j)
            {
                const Real cx = s.centre_x_m[i] - s.centre_x_m[j];
                const Real cy = s.centre_y_m[i] - s.centre_y_m[j];
                nearest2 = L::Min(nearest2, cx * cx + cy * cy);
                m.contacts += L::One(Norm2(s, i, j) < s.touch_m * s.touch_m);
            }
        m.diffusion = L::Sqrt(nearest2) / s.range_m;
        m.groups = Groups(s);
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

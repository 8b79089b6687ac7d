// SPDX-License-Identifier: Apache-2.0
// W worlds of robots without memory in their drive: a table row is a constant velocity, so that
// a step is a rotation and a displacement worked out beforehand. Same rules as Swarm, PlanarBodies
// and ConeSensor; differences are those of rounding.
#ifndef SWEEP_BATCH_KERNEL_H
#define SWEEP_BATCH_KERNEL_H

#include "plant/split_mix.h"
#include "sensor/view_lanes.h"
#include "swarm/metrics_lanes.h"
#include "sweep/batch_plan.h"

namespace twin
{

template <int W>
class BatchKernel
{
    using L = Lanes<W>;
    using Real = typename L::Real;
    using Mask = typename L::Mask;
    using Bits = typename L::Bits;
    using View = ViewFormulas<W>;
    using Point = PointLanes<W>;

public:
    BatchKernel(const BatchPlan &plan, double *numbers)
        : p_(plan), n_(plan.n), at_(plan), numbers_(reinterpret_cast<Real *>(numbers))
    {
    }

    const Real *Columns() const { return numbers_; }
    // Robot by robot, bit by bit.
    Mask *Seen() const { return BitsAt(at_.seen); }

    // InView() of the cone sensor for one bit of a robot. Its ahead > cos * distance is squared
    // with the signs kept, which spares the root. With kWorld its bodies are seen, and hide.
    template <bool kDisc, bool kWorld>
    void Sense(int bit, int robot, int step)
    {
        const auto eye = [&](int column) { return Column(at_.OfBit(bit, column))[robot]; };
        const uint8_t *shown = p_.shown + bit * n_;
        const Real *x = Column(kX), *y = Column(kY);
        const Real axis_c = eye(kAxisCos), axis_s = eye(kAxisSin);
        const Real ci = Column(kCos)[robot], si = Column(kSin)[robot];
        const Real c = ci * axis_c - si * axis_s, s = si * axis_c + ci * axis_s;
        const Real range2 = eye(kRange2), cone = eye(kCone);
        Mask seen{};
        for (int j = 0; j < n_; ++j)
        {
            if (j == robot || !shown[j])
                continue;
            const Real dx = x[j] - x[robot], dy = y[j] - y[robot], d2 = dx * dx + dy * dy;
            const Real ahead = c * dx + s * dy;
            Mask inside = ahead * L::Abs(ahead) > cone * d2;
            if constexpr (kDisc)
                inside |= Edge(bit, robot, ahead, L::Abs(c * dy - s * dx));
            inside &= d2 < range2;
            if constexpr (kWorld)
                if (L::Any(inside))
                    inside &= ~HiddenByBody(robot, {x[j], y[j]}, -1, step);
            seen |= inside;
        }
        if constexpr (kWorld)
            seen |= SeesBody(
                bit, robot,
                {{x[robot], y[robot]}, c, s, eye(kHalfCos), eye(kHalfSin), L::Sqrt(range2)}, step);
        Seen()[bit * n_ + robot] = seen;
    }

    // The rest of a step once it is clear what robots see.
    void Finish(int step)
    {
        if (p_.errors)
            Err();
        Decide(step);
        const bool moves = p_.steps[step].frame >= 0;
        for (int i = 0; (moves || p_.world.body_count) && i < p_.substeps; ++i)
        {
            if (moves && p_.bits == 1)
                Move<true>();
            else if (moves)
                Move<false>();
            PushApart();
            if (p_.world.body_count)
                StopAtWorld(step * p_.substeps + i + 1);
        }
        if (p_.world.body_count)
            WatchEvaders(step);
        if (p_.steps[step].measured)
            Measure(moves);
    }

private:
    Real *Column(int column) const { return numbers_ + column * n_; }
    Mask *BitsAt(int at) const { return reinterpret_cast<Mask *>(numbers_ + at); }

    // Whether the disc reaches over the edge of that cone of `robot`.
    Mask Edge(int bit, int robot, Real ahead, Real aside) const
    {
        const auto eye = [&](int column) { return Column(at_.OfBit(bit, column))[robot]; };
        const Real cos_half = eye(kHalfCos), sin_half = eye(kHalfSin);
        const Real along = L::Max(ahead * cos_half + aside * sin_half, Real{});
        const Real over = ahead - along * cos_half, off = aside - along * sin_half;
        return over * over + off * off < eye(kTarget2);
    }

    // Of all bodies of the world after so many substeps.
    const PlainCapsule *Places(int substeps) const
    {
        return p_.places + substeps * p_.world.body_count;
    }

    // As ConeSensor: whether a solid body, `but` apart, is between a robot and a point.
    Mask HiddenByBody(int robot, const Point &point, int but, int step) const
    {
        const Point eye{Column(kX)[robot], Column(kY)[robot]};
        const PlainCapsule *places = Places(step * p_.substeps);
        Mask hidden{};
        for (int b = 0; b < p_.world.body_count; ++b)
            if (b != but && p_.world.bodies[b].is_solid)
                hidden |= CapsuleFormulas<W>::Crosses(places[b], eye, point);
        return hidden;
    }

    Mask SeesBody(int bit, int robot, const EyeLanes<W> &eye, int step) const
    {
        const uint8_t *shown = p_.bodies_shown + bit * p_.world.body_count;
        const PlainCapsule *places = Places(step * p_.substeps);
        Mask seen{};
        for (int b = 0; b < p_.world.body_count; ++b)
        {
            if (!shown[b])
                continue;
            const auto part = View::PartInView(eye, places[b]);
            if (L::Any(part.in_view))
                seen |= part.in_view & ~HiddenByBody(robot, part.at, b, step);
        }
        return seen;
    }

    void Err()
    {
        Mask *seen = BitsAt(at_.seen);
        Bits *dice = reinterpret_cast<Bits *>(Column(kDice));
        const Mask *miss = reinterpret_cast<Mask *>(Column(kMiss));
        const Mask *imagined = reinterpret_cast<Mask *>(Column(kFalse));
        for (int bit = 0; bit < p_.bits; ++bit, seen += n_)
            for (int i = 0; i < n_; ++i)
                seen[i] ^= (Mask)(SplitMix(dice[i]) >> 11) < (seen[i] ? miss[i] : imagined[i]);
    }

    // Frames travel, then vote. The firmware takes the newest frame alone, once.
    void Decide(int step)
    {
        if (p_.kept_frames == 1 && p_.vote_frames == 1)
            return;
        const int n = p_.bits * n_;
        Mask *seen = BitsAt(at_.seen), *ones = BitsAt(at_.ones);
        Mask *sent = BitsAt(at_.frames) + (step % p_.kept_frames) * n;
        for (int i = 0; i < n; ++i)
            sent[i] = seen[i];
        const BatchStep now = p_.steps[step];
        const Mask *arrived = BitsAt(at_.frames) + now.frame * n;
        Mask *slot = BitsAt(at_.votes) + now.slot * n;
        for (int i = 0; now.slot >= 0 && i < n; ++i)
        {
            ones[i] += slot[i] - arrived[i];  // a set bit is -1
            slot[i] = arrived[i];
        }
        for (int i = 0; i < n; ++i)
            seen[i] = ones[i] + ones[i] > now.voters;
    }

    // The entry of that column in the row that the bits of a robot choose.
    template <bool kOneBit>
    Real Chosen(int column, int robot) const
    {
        const Mask *seen = BitsAt(at_.seen) + robot;
        const Real *first = Column(at_.OfRow(0, column)) + robot;
        const int apart = kRowColumns * n_;
        if constexpr (kOneBit)
            return *seen ? first[apart] : *first;
        Real rows[kMostRows];
        int count = 1 << p_.bits;
        for (int row = 0; row < count; ++row)
            rows[row] = first[row * apart];
        for (; count > 1; count /= 2, seen += n_)
            for (int row = 0; row < count / 2; ++row)
                rows[row] = *seen ? rows[2 * row + 1] : rows[2 * row];
        return rows[0];
    }

    template <bool kOneBit>
    void Move()
    {
        Real *x = Column(kX), *y = Column(kY), *c = Column(kCos), *s = Column(kSin);
        for (int i = 0; i < n_; ++i)
        {
            const auto driven = [&](int column) { return Chosen<kOneBit>(column, i); };
            const Real ahead = driven(kRowX), left = driven(kRowY);
            const Real turn_c = driven(kRowCos), turn_s = driven(kRowSin);
            const Real ci = c[i], si = s[i];
            x[i] += ci * ahead - si * left;
            y[i] += si * ahead + ci * left;
            c[i] = ci * turn_c - si * turn_s;
            s[i] = si * turn_c + ci * turn_s;
        }
    }

    // As twin::PushApart(): each by half of the overlap, all at once.
    void PushApart()
    {
        if (p_.body_m == 0)
            return;
        Real *x = Column(kX), *y = Column(kY), *x0 = Column(kScratch), *y0 = Column(kScratch + 1);
        for (int i = 0; i < n_; ++i)
        {
            x0[i] = x[i];
            y0[i] = y[i];
        }
        const Real zero{}, body2 = L::All(p_.body_m * p_.body_m);
        for (int i = 0; i < n_; ++i)
            for (int j = i + 1; j < n_; ++j)
            {
                const Real dx = x0[j] - x0[i], dy = y0[j] - y0[i], d2 = dx * dx + dy * dy;
                const Mask overlaps = (d2 < body2) & (d2 != 0);
                if (!L::Any(overlaps))
                    continue;
                const Real push = overlaps ? (p_.body_m / L::Sqrt(d2) - 1) / 2 : zero;
                x[i] -= push * dx;
                y[i] -= push * dy;
                x[j] += push * dx;
                y[j] += push * dy;
            }
    }

    // As twin::PushOut() without friction, after so many substeps.
    void StopAtWorld(int substeps)
    {
        if (p_.body_m == 0)
            return;
        Real *x = Column(kX), *y = Column(kY);
        const PlainCapsule *places = Places(substeps);
        for (int b = 0; b < p_.world.body_count; ++b)
        {
            if (!p_.world.bodies[b].is_solid)
                continue;
            const Point from = CapsuleFormulas<W>::From(places[b]);
            const Point to = CapsuleFormulas<W>::To(places[b]);
            const double touch_m = p_.body_m / 2 + places[b].radius_m;
            for (int i = 0; i < n_; ++i)
            {
                const Point at = CapsuleFormulas<W>::Nearest(from, to, {x[i], y[i]});
                const Real dx = at.x_m - x[i], dy = at.y_m - y[i], d2 = dx * dx + dy * dy;
                const Mask overlaps = (d2 < touch_m * touch_m) & (d2 != 0);
                if (!L::Any(overlaps))
                    continue;
                const Real push = overlaps ? touch_m / L::Sqrt(d2) - 1 : Real{};
                x[i] -= push * dx;
                y[i] -= push * dy;
            }
        }
    }

    void WatchEvaders(int step)
    {
        Real *sums = numbers_ + at_.sums;
        DefenceLanes<W> now{sums[kCaught], sums[kReached], sums[kInside]};
        DefenceFormulas<W>::Add(p_.world, Places((step + 1) * p_.substeps), Column(kX), Column(kY),
                                (step + 1) * p_.step_s, BitsAt(at_.caught), now);
        sums[kCaught] = now.caught_s;
        sums[kReached] = now.reached_s;
        sums[kInside] = now.inside;
    }

    void Measure(bool moves)
    {
        Real *motion = Column(kMotionNow);
        for (int i = 0; i < n_; ++i)
            for (int k = 0; k < kMotion; ++k)
                motion[k * n_ + i] = moves ? Chosen<false>(kRowMotion + k, i) : Real{};
        const MetricLanes<W> m = MetricFormulas<W>::Measure(
            {n_, p_.ring, Column(kX), Column(kY), Column(kCos), Column(kSin), motion,
             Column(kScratch), Column(kScratch + 1), Column(kScratch + 2), numbers_[at_.range],
             p_.touch_m});
        Real *sums = numbers_ + at_.sums;
        sums[kCirclinessSum] += m.circliness;
        sums[kRadiusSum] += m.radius_m;
        sums[kScatterSum] += m.scatter_m2;
        sums[kRotationSum] += m.rotation;
        sums[kOddSum] += m.odd_ratio;
        sums[kDiffusionSum] += m.diffusion;
        sums[kGroupsSum] += m.groups;
        sums[kContactsSum] += m.contacts;
        sums[kLeastDiffusion] = L::Min(sums[kLeastDiffusion], m.diffusion);
    }

    const BatchPlan &p_;
    int n_;
    BatchLayout at_;
    Real *numbers_;
};

}  // namespace twin

#endif

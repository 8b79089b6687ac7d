// SPDX-License-Identifier: Apache-2.0
// W worlds of robots without memory in their drive: a table row is a constant velocity, so that
// a step is a rotation and a displacement worked out beforehand. Same rules as Swarm, PlanarBodies
// and ConeSensor; differences are those of rounding.
#ifndef SWEEP_BATCH_KERNEL_H
#define SWEEP_BATCH_KERNEL_H

#include "plant/split_mix.h"
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

public:
    BatchKernel(const BatchPlan &plan, double *numbers)
        : p_(plan), n_(plan.n), at_(plan), numbers_(reinterpret_cast<Real *>(numbers))
    {
    }

    const Real *Columns() const { return numbers_; }
    Mask *Seen() const { return BitsAt(at_.seen); }

    // InView() of the cone sensor for one robot. Its ahead > cos * distance is squared with the
    // signs kept, which spares the root.
    template <bool kDisc>
    void Sense(int robot)
    {
        const Real *x = Column(kX), *y = Column(kY);
        const Real c = Column(kCos)[robot], s = Column(kSin)[robot];
        const Real range2 = Column(kRange2)[robot], cone = Column(kCone)[robot];
        Mask seen{};
        for (int j = 0; j < n_; ++j)
        {
            if (j == robot)
                continue;
            const Real dx = x[j] - x[robot], dy = y[j] - y[robot], d2 = dx * dx + dy * dy;
            const Real ahead = c * dx + s * dy;
            Mask inside = ahead * L::Abs(ahead) > cone * d2;
            if constexpr (kDisc)
                inside |= Edge(robot, ahead, L::Abs(c * dy - s * dx));
            seen |= inside & (d2 < range2);
        }
        Seen()[robot] = seen;
    }

    // The rest of a step once it is clear what robots see.
    void Finish(int step)
    {
        if (p_.errors)
            Err();
        Decide(step);
        const bool moves = p_.steps[step].frame >= 0;
        for (int i = 0; moves && i < p_.substeps; ++i)
        {
            Move();
            PushApart();
        }
        if (p_.steps[step].measured)
            Measure(moves);
    }

private:
    Real *Column(int column) const { return numbers_ + column * n_; }
    Mask *BitsAt(int at) const { return reinterpret_cast<Mask *>(numbers_ + at); }

    // Whether the disc reaches over the edge of the cone of `robot`.
    Mask Edge(int robot, Real ahead, Real aside) const
    {
        const Real cos_half = Column(kHalfCos)[robot], sin_half = Column(kHalfSin)[robot];
        const Real along = L::Max(ahead * cos_half + aside * sin_half, Real{});
        const Real over = ahead - along * cos_half, off = aside - along * sin_half;
        return over * over + off * off < Column(kTarget2)[robot];
    }

    void Err()
    {
        Mask *seen = BitsAt(at_.seen);
        Bits *dice = reinterpret_cast<Bits *>(Column(kDice));
        const Mask *miss = reinterpret_cast<Mask *>(Column(kMiss));
        const Mask *imagined = reinterpret_cast<Mask *>(Column(kFalse));
        for (int i = 0; i < n_; ++i)
            seen[i] ^= (Mask)(SplitMix(dice[i]) >> 11) < (seen[i] ? miss[i] : imagined[i]);
    }

    // Frames travel, then vote. The firmware takes the newest frame alone, once.
    void Decide(int step)
    {
        if (p_.kept_frames == 1 && p_.vote_frames == 1)
            return;
        Mask *seen = BitsAt(at_.seen), *ones = BitsAt(at_.ones);
        Mask *sent = BitsAt(at_.frames) + (step % p_.kept_frames) * n_;
        for (int i = 0; i < n_; ++i)
            sent[i] = seen[i];
        const BatchStep now = p_.steps[step];
        const Mask *arrived = BitsAt(at_.frames) + now.frame * n_;
        Mask *slot = BitsAt(at_.votes) + now.slot * n_;
        for (int i = 0; now.slot >= 0 && i < n_; ++i)
        {
            ones[i] += slot[i] - arrived[i];  // a set bit is -1
            slot[i] = arrived[i];
        }
        for (int i = 0; i < n_; ++i)
            seen[i] = ones[i] + ones[i] > now.voters;
    }

    void Move()
    {
        const int n = n_;
        const Mask *seen = BitsAt(at_.seen);
        const Real *unseen_row = Column(kUnseenX), *seen_row = Column(kSeenX);
        Real *x = Column(kX), *y = Column(kY), *c = Column(kCos), *s = Column(kSin);
        for (int i = 0; i < n; ++i)
        {
            const auto driven = [&](int column) {
                const int at = column * n + i;
                return seen[i] ? seen_row[at] : unseen_row[at];
            };
            const Real ahead = driven(0), left = driven(1), turn_c = driven(2), turn_s = driven(3);
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

    void Measure(bool moves)
    {
        const Mask *seen = BitsAt(at_.seen);
        Real *motion = Column(kMotionNow);
        for (int i = 0; i < n_; ++i)
            for (int k = 0; k < kMotion; ++k)
                motion[k * n_ + i] = !moves    ? Real{}
                                     : seen[i] ? Column(kSeenMotion + k)[i]
                                               : Column(kUnseenMotion + k)[i];
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

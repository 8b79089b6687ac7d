// SPDX-License-Identifier: Apache-2.0
// What robots see, worked out in single precision for two halves of a batch at once, with a bound
// on its error: where that leaves doubt, doubles must tell.
#ifndef SWEEP_PREFILTER_H
#define SWEEP_PREFILTER_H

#include "single_lanes.h"
#include "sweep/batch_plan.h"

namespace twin
{

template <int W>
class Prefilter
{
    using S = SingleLanes<W>;
    using Real = typename S::Real;
    using Mask = typename S::Mask;
    using Double = typename S::Double;

public:
    // `low`, `high`: the columns of each half; `memory`: kPrefilterColumns * n * W doubles.
    Prefilter(const BatchPlan &plan, const Double *low, const Double *high, double *memory)
        : n_(plan.n),
          // What bodies push each other is not bounded as well as what robots drive.
          refresh_(plan.body_m > 0 ? 1 : kRefresh),
          slack_m_(S::All(static_cast<float>((refresh_ - 1) * plan.most_m))),
          low_(low),
          high_(high),
          memory_(reinterpret_cast<Real *>(memory))
    {
        const BatchLayout at(plan);
        Load(at.OfBit(0, kRange2), kScreenRange2);
        Load(at.OfBit(0, kCone), kScreenCone);
        Load(at.OfBit(0, kHalfCos), kScreenHalfCos);
        Load(at.OfBit(0, kHalfSin), kScreenHalfSin);
        Load(at.OfBit(0, kTarget2), kScreenTarget2);
        range2_ = Most(kScreenRange2);
        for (int i = 0; i < 2 * W; ++i)
            range_[i] = __builtin_sqrtf(range2_[i]);
    }

    // Finds for each robot a number that is above 0 if and only if it sees another, or else
    // doubtful.
    template <bool kDisc>
    void Sense(int step)
    {
        Load(kX, kScreenX);
        Load(kY, kScreenY);
        Load(kCos, kScreenCos);
        Load(kSin, kScreenSin);
        FindMarginsOfFew<kDisc>();
        if (step % refresh_ == 0)
            band_ = Band<kDisc>(S::Max(Most(kScreenX), Most(kScreenY)) + slack_m_);
    }

    // Whether a margin is too near 0 to tell.
    bool Doubtful(int robot) const
    {
        return S::Any(~(S::Abs(Column(kScreenMargin)[robot]) > band_));
    }

    Mask Seen(int robot) const { return Column(kScreenMargin)[robot] > 0; }

private:
    static constexpr int kMostUnrolled = 8;
    static constexpr int kRefresh = 16;  // steps for which the band is worked out

    Real *Column(int column) const { return memory_ + column * n_; }

    void Load(int from, int to)
    {
        const Double *low = low_ + from * n_, *high = high_ + from * n_;
        for (int i = 0; i < n_; ++i)
            Column(to)[i] = S::Join(low[i], high[i]);
    }

    Real Most(int column) const
    {
        Real most{};
        for (int i = 0; i < n_; ++i)
            most = S::Max(most, S::Abs(Column(column)[i]));
        return most;
    }

    // FindMargins() with all loops unrolled for small swarms.
    template <bool kDisc, int N = kMostUnrolled>
    void FindMarginsOfFew()
    {
        if (n_ == N)
            FindMargins<kDisc, N>();
        else if constexpr (N > 2)
            FindMarginsOfFew<kDisc, N - 1>();
        else
            FindMargins<kDisc, 0>();
    }

    // The tests of BatchKernel::Sense as areas, positive inside: the robot sees the other if both
    // the range's and the cone's are. The largest over the others is kept.
    template <bool kDisc, int N>
    void FindMargins()
    {
        const int n = N ? N : n_;
        const Real *x = Column(kScreenX), *y = Column(kScreenY), *c = Column(kScreenCos),
                   *s = Column(kScreenSin), *range2 = Column(kScreenRange2);
        Real *margin = Column(kScreenMargin);
        for (int i = 0; i < n; ++i)
            margin[i] = S::All(-__FLT_MAX__);
#pragma GCC unroll 8
        for (int i = 0; i < n; ++i)
        {
            const Real xi = x[i], yi = y[i], ci = c[i], si = s[i], range2i = range2[i];
            Real margin_i = margin[i];
#pragma GCC unroll 8
            for (int j = i + 1; j < n; ++j)
            {
                const Real dx = x[j] - xi, dy = y[j] - yi, d2 = S::MulAdd(dx, dx, dy * dy);
                const Real ahead_i = S::MulAdd(ci, dx, si * dy);
                const Real behind_j = S::MulAdd(c[j], dx, s[j] * dy);
                Real in_i = Inside(i, ahead_i, d2), in_j = Inside(j, -behind_j, d2);
                if constexpr (kDisc)
                {
                    in_i = S::Max(in_i, Edge(i, ahead_i, S::Abs(ci * dy - si * dx)));
                    in_j = S::Max(in_j, Edge(j, -behind_j, S::Abs(c[j] * dy - s[j] * dx)));
                }
                margin_i = S::Max(margin_i, S::Min(in_i, range2i - d2));
                margin[j] = S::Max(margin[j], S::Min(in_j, range2[j] - d2));
            }
            margin[i] = margin_i;
        }
    }

    Real Inside(int robot, Real ahead, Real d2) const
    {
        return S::MulAdd(ahead, S::Abs(ahead), -(Column(kScreenCone)[robot] * d2));
    }

    Real Edge(int robot, Real ahead, Real aside) const
    {
        const Real cos_half = Column(kScreenHalfCos)[robot];
        const Real sin_half = Column(kScreenHalfSin)[robot];
        const Real along = S::Max(ahead * cos_half + aside * sin_half, Real{});
        const Real over = ahead - along * cos_half, off = aside - along * sin_half;
        return Column(kScreenTarget2)[robot] - (over * over + off * off);
    }

    // Most that rounding moves a margin that decides, in an area within range R of a robot whose
    // coordinates are up to M = `far`. With u = 2^-24, a difference of positions is off by
    // 2.9 u M + u d, what is ahead by 2.95 u M + 4.1 u d, its square less the cone's by
    // 11.7 u M d + 17.3 u d^2 + 18 (u M)^2, all for d <= R; an edge's square by
    // 20.4 u M d + 50 u d^2 + 104 (u M)^2. Beyond R the range's margin is below the band, too.
    template <bool kDisc>
    Real Band(Real far) const
    {
        constexpr float u = 0x1p-24f;
        constexpr float by_far = (kDisc ? 24 : 12) * u, by_range = (kDisc ? 64 : 18) * u,
                        by_far2 = (kDisc ? 128 : 32) * u * u;
        return far * (by_far * range_ + by_far2 * far) + by_range * range2_;
    }

    int n_, refresh_;
    Real slack_m_;
    const Double *low_, *high_;
    Real *memory_;
    Real range_, range2_, band_;
};

}  // namespace twin

#endif

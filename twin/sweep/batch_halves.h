// SPDX-License-Identifier: Apache-2.0
// 2 W worlds to their end: what is seen in single precision where that is sure, all else in
// doubles.
#ifndef SWEEP_BATCH_HALVES_H
#define SWEEP_BATCH_HALVES_H

#include "batch_kernel.h"
#include "prefilter.h"

namespace twin
{

template <int W>
class BatchHalves
{
public:
    BatchHalves(const BatchPlan &plan, double *numbers)
        : p_(plan),
          low_(plan, numbers),
          high_(plan, numbers + BatchLayout(plan).size * W),
          prefilter_(plan, low_.Columns(), high_.Columns(),
                     numbers + 2 * BatchLayout(plan).size * W)
    {
    }

    void Run()
    {
        for (int step = 0; step < p_.step_count; ++step)
        {
            if (p_.target_is_disc)
                Sense<true>(step);
            else
                Sense<false>(step);
            low_.Finish(step);
            high_.Finish(step);
        }
    }

private:
    template <bool kDisc>
    void Sense(int step)
    {
        if (p_.world.body_count)
            return SenseAll<kDisc, true>(step);
        if (!p_.prefilters)
            return SenseAll<kDisc, false>(step);
        prefilter_.template Sense<kDisc>(step);
        for (int i = 0; i < p_.n; ++i)
            if (prefilter_.Doubtful(i))
                SenseBoth<kDisc, false>(0, i, step);
            else
            {
                const auto seen = prefilter_.Seen(i);
                low_.Seen()[i] = SingleLanes<W>::Low(seen);
                high_.Seen()[i] = SingleLanes<W>::High(seen);
            }
    }

    template <bool kDisc, bool kWorld>
    void SenseAll(int step)
    {
        for (int bit = 0; bit < p_.bits; ++bit)
            for (int i = 0; i < p_.n; ++i)
                SenseBoth<kDisc, kWorld>(bit, i, step);
    }

    template <bool kDisc, bool kWorld>
    void SenseBoth(int bit, int robot, int step)
    {
        low_.template Sense<kDisc, kWorld>(bit, robot, step);
        high_.template Sense<kDisc, kWorld>(bit, robot, step);
    }

    const BatchPlan &p_;
    BatchKernel<W> low_, high_;
    Prefilter<W> prefilter_;
};

}  // namespace twin

#endif

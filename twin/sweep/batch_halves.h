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
        if (!p_.prefilters)
        {
            for (int bit = 0; bit < p_.bits; ++bit)
                for (int i = 0; i < p_.n; ++i)
                {
                    low_.template Sense<kDisc>(bit, i);
                    high_.template Sense<kDisc>(bit, i);
                }
            return;
        }
        prefilter_.template Sense<kDisc>(step);
        for (int i = 0; i < p_.n; ++i)
            if (prefilter_.Doubtful(i))
            {
                low_.template Sense<kDisc>(0, i);
                high_.template Sense<kDisc>(0, i);
            }
            else
            {
                const auto seen = prefilter_.Seen(i);
                low_.Seen()[i] = SingleLanes<W>::Low(seen);
                high_.Seen()[i] = SingleLanes<W>::High(seen);
            }
    }

    const BatchPlan &p_;
    BatchKernel<W> low_, high_;
    Prefilter<W> prefilter_;
};

}  // namespace twin

#endif

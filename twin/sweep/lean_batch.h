// SPDX-License-Identifier: Apache-2.0
// 2 W worlds to their end: what is seen in single precision where that is sure, all else in
// doubles.
#ifndef SWEEP_LEAN_BATCH_H
#define SWEEP_LEAN_BATCH_H

#include "lean_kernel.h"
#include "lean_screen.h"

namespace twin
{

template <int W>
class LeanBatch
{
public:
    LeanBatch(const LeanPlan &plan, double *numbers)
        : p_(plan),
          low_(plan, numbers),
          high_(plan, numbers + LeanLayout(plan).size * W),
          screen_(plan, low_.Columns(), high_.Columns(), numbers + 2 * LeanLayout(plan).size * W)
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
        if (p_.screens)
            screen_.template Sense<kDisc>(step);
        for (int i = 0; i < p_.n; ++i)
            if (!p_.screens || screen_.Doubtful(i))
            {
                low_.template Sense<kDisc>(i);
                high_.template Sense<kDisc>(i);
            }
            else
            {
                const auto seen = screen_.Seen(i);
                low_.Seen()[i] = SingleLanes<W>::Low(seen);
                high_.Seen()[i] = SingleLanes<W>::High(seen);
            }
    }

    const LeanPlan &p_;
    LeanKernel<W> low_, high_;
    LeanScreen<W> screen_;
};

}  // namespace twin

#endif

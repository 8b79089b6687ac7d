// SPDX-License-Identifier: Apache-2.0
// 2 worlds at once: the vectors of any processor.
#include "lean_kernel.h"

void twin::LeanAdvance2(const LeanPlan &plan, double *numbers, int from, int to)
{
    LeanKernel<2>(plan, numbers).Advance(from, to);
}

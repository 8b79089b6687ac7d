// SPDX-License-Identifier: Apache-2.0
// 4 worlds at once: compiled for AVX2.
#include "lean_kernel.h"

void twin::LeanAdvance4(const LeanPlan &plan, double *numbers, int from, int to)
{
    LeanKernel<4>(plan, numbers).Advance(from, to);
}

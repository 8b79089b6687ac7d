// SPDX-License-Identifier: Apache-2.0
// 8 worlds at once: compiled for AVX-512.
#include "lean_kernel.h"

void twin::LeanAdvance8(const LeanPlan &plan, double *numbers, int from, int to)
{
    LeanKernel<8>(plan, numbers).Advance(from, to);
}

// SPDX-License-Identifier: Apache-2.0
// 8 worlds at once: compiled for AVX2.
#include "lean_batch.h"

void twin::LeanAdvance8(const LeanPlan &plan, double *numbers)
{
    LeanBatch<4>(plan, numbers).Run();
}

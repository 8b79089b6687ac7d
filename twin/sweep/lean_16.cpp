// SPDX-License-Identifier: Apache-2.0
// 16 worlds at once: compiled for AVX-512.
#include "lean_batch.h"

void twin::LeanAdvance16(const LeanPlan &plan, double *numbers)
{
    LeanBatch<8>(plan, numbers).Run();
}

// SPDX-License-Identifier: Apache-2.0
// 8 worlds at once: compiled for AVX2.
#include "batch_halves.h"

void twin::BatchAdvance8(const BatchPlan &plan, double *numbers)
{
    BatchHalves<4>(plan, numbers).Run();
}

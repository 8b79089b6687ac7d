// SPDX-License-Identifier: Apache-2.0
// 16 worlds at once: compiled for AVX-512.
#include "batch_halves.h"

void twin::BatchAdvance16(const BatchPlan &plan, double *numbers)
{
    BatchHalves<8>(plan, numbers).Run();
}

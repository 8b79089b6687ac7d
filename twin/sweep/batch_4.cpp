// SPDX-License-Identifier: Apache-2.0
// 4 worlds at once: in vectors of 2 doubles: any processor.
#include "batch_halves.h"

void twin::BatchAdvance4(const BatchPlan &plan, double *numbers)
{
    BatchHalves<2>(plan, numbers).Run();
}

// SPDX-License-Identifier: Apache-2.0
// 4 worlds at once: in vectors of 2 doubles: any processor.
#include "lean_batch.h"

void twin::LeanAdvance4(const LeanPlan &plan, double *numbers)
{
    LeanBatch<2>(plan, numbers).Run();
}

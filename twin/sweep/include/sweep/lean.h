// SPDX-License-Identifier: Apache-2.0
// Batches of worlds for the lean kernel.
#ifndef SWEEP_LEAN_H
#define SWEEP_LEAN_H

#include <span>

#include "sweep/lean_plan.h"
#include "sweep/worlds.h"

namespace twin
{

struct LeanWidth
{
    size_t lanes;
    LeanAdvance advance;
};

// The kernels that this processor runs, widest first. All give the same bytes.
std::span<const LeanWidth> LeanWidths();

// Whether both may be lanes of one batch.
bool SameBatch(const Cell &a, const Cell &b);

// Runs up to width.lanes worlds that may share a batch. `screens`: LeanPlan::screens.
void RunLean(const LeanWidth &width, std::span<const World> worlds, double duration_s,
             std::span<Outcome> outcomes, bool screens = true);

// Steps of a run, and the first that counts for the metrics' window.
struct StepCount
{
    int steps, first_measured;
};
StepCount CountSteps(double period_s, double duration_s);

}  // namespace twin

#endif

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

// Steps of a run. Every `stride`-th is a sample, the last one too; those from `first_measured` on
// are what is measured at the end of the run.
struct StepCount
{
    int steps, first_measured, stride;
    bool Samples(int step) const { return (step - first_measured) % stride == 0; }
    bool Measures(int step) const { return step >= first_measured && Samples(step); }
    int Measured() const { return (steps - 1 - first_measured) / stride + 1; }
};
StepCount CountSteps(double period_s, double duration_s);

}  // namespace twin

#endif

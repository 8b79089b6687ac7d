// SPDX-License-Identifier: Apache-2.0
// Batches of worlds for the batched kernel.
#ifndef SWEEP_BATCH_H
#define SWEEP_BATCH_H

#include <span>
#include <string>

#include "sweep/batch_plan.h"
#include "sweep/cell.h"

namespace twin
{

struct BatchWidth
{
    size_t lanes;
    BatchAdvance advance;
};

// The kernels that this processor runs, widest first. All give the same bytes.
std::span<const BatchWidth> BatchWidths();

// Why the batched kernel cannot run this model: effects, lag, noise, a delay near the firmware's
// time-out. Empty if it can.
std::string WhyNotBatched(const Model &model);

// Whether both may be lanes of one batch.
bool SameBatch(const Cell &a, const Cell &b);

// Runs up to width.lanes worlds that may share a batch. `prefilters`: BatchPlan::prefilters.
void RunBatch(const BatchWidth &width, std::span<const World> worlds, double duration_s,
              std::span<Outcome> outcomes, bool prefilters = true);

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

// SPDX-License-Identifier: Apache-2.0
// What the batched kernel works on: plain numbers, laid out by the caller. No headers of
// the library, see lanes.h.
#ifndef SWEEP_BATCH_PLAN_H
#define SWEEP_BATCH_PLAN_H

#include <stdint.h>

#include "swarm/metrics_lanes.h"

namespace twin
{

// Columns of n robots each.
enum BatchColumn
{
    // State.
    kX,
    kY,
    kCos,
    kSin,
    // Range squared; cos(half cone) times its absolute value.
    kRange2,
    kCone,
    // For targets that are discs: cosine and sine of the half cone, radius squared.
    kHalfCos,
    kHalfSin,
    kTarget2,
    // Integers: the stream of the sensor's errors, and from which of its numbers in [0, 2^53) on a
    // frame is right when something is in view, when nothing is.
    kDice,
    kMiss,
    kFalse,
    // A row of the table: displacement in the body frame and rotation in one substep.
    kUnseenX,
    kUnseenY,
    kUnseenCos,
    kUnseenSin,
    kSeenX,
    kSeenY,
    kSeenCos,
    kSeenSin,
    // And its motion, see swarm/metrics_lanes.h.
    kUnseenMotion,
    kSeenMotion = kUnseenMotion + kMotion,
    kMotionNow = kSeenMotion + kMotion,
    // Scratch.
    kScratch = kMotionNow + kMotion,
    kBatchColumns = kScratch + 3,
};

// Columns of n robots in single precision, 2 W worlds.
enum PrefilterColumn
{
    kScreenX,
    kScreenY,
    kScreenCos,
    kScreenSin,
    kScreenRange2,
    kScreenCone,
    kScreenHalfCos,
    kScreenHalfSin,
    kScreenTarget2,
    kScreenMargin,
    kPrefilterColumns,
};

enum BatchSum
{
    kCirclinessSum,
    kRadiusSum,
    kScatterSum,
    kRotationSum,
    kOddSum,
    kDiffusionSum,
    kGroupsSum,
    kContactsSum,
    kLeastDiffusion,
    kBatchSums,
};

// What the controller knows in a step: the same for all robots.
struct BatchStep
{
    int32_t frame;   // newest that has reached it, modulo kept_frames; -1: none so far
    int32_t slot;    // of the vote that it takes; -1: it voted before
    int32_t voters;  // frames that count
    bool measured;
};

// What all lanes of a batch share.
struct BatchPlan
{
    int n, ring, step_count, substeps;
    int vote_frames;  // majority over this many
    int kept_frames;  // of the sensor, newest included
    const BatchStep *steps;
    bool target_is_disc, errors;
    bool prefilters;  // in single precision first; results are the same to the bit
    double most_m;    // that a robot may drive in a step
    double body_m;    // diameter; 0: no bodies
    double touch_m;   // nearer bodies count as in contact
};

// Numbers of one lane, in units of the lane count: columns, range, sums, bits seen, votes' ones,
// frames on the way, frames that vote. `total`: of two halves of a batch and their prefilter.
struct BatchLayout
{
    // Always inlined: see lanes.h on inline functions that are compiled for several processors.
    [[gnu::always_inline]] explicit BatchLayout(const BatchPlan &p)
        : range(kBatchColumns * p.n),
          sums(range + 1),
          seen(sums + kBatchSums),
          ones(seen + p.n),
          frames(ones + p.n),
          votes(frames + p.kept_frames * p.n),
          size(votes + p.vote_frames * p.n),
          total(2 * size + kPrefilterColumns * p.n)
    {
    }
    int range, sums, seen, ones, frames, votes, size, total;
};

// Runs all steps of 2 W worlds. `numbers`: BatchLayout::total * W doubles, aligned to 64 bytes:
// those of the first W worlds, of the others, of the prefilter.
using BatchAdvance = void (*)(const BatchPlan &, double *numbers);

void BatchAdvance4(const BatchPlan &, double *numbers);
#ifdef __x86_64__
void BatchAdvance8(const BatchPlan &, double *numbers);
void BatchAdvance16(const BatchPlan &, double *numbers);
#endif

}  // namespace twin

#endif

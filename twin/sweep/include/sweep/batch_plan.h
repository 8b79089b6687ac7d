// SPDX-License-Identifier: Apache-2.0
// What the batched kernel works on: plain numbers, laid out by the caller. No headers of
// the library, see lanes.h.
#ifndef SWEEP_BATCH_PLAN_H
#define SWEEP_BATCH_PLAN_H

#include <stdint.h>

#include "swarm/metrics_lanes.h"
#include "sweep/defence_lanes.h"

namespace twin
{

// Columns of n robots each: these, kBitColumns for each bit, kRowColumns for each row.
enum BatchColumn
{
    // State.
    kX,
    kY,
    kCos,
    kSin,
    // Integers: the stream of the sensor's errors, and from which of its numbers in [0, 2^53) on a
    // frame is right when something is in view, when nothing is.
    kDice,
    kMiss,
    kFalse,
    // The motion now, see swarm/metrics_lanes.h.
    kMotionNow,
    // Scratch.
    kScratch = kMotionNow + kMotion,
    kRobotColumns = kScratch + 3,
};

// Of one bit.
enum BitColumn
{
    // Its cone's axis from the heading.
    kAxisCos,
    kAxisSin,
    // Range squared; cos(half cone) times its absolute value.
    kRange2,
    kCone,
    // For targets that are discs: cosine and sine of the half cone, radius squared.
    kHalfCos,
    kHalfSin,
    kTarget2,
    kBitColumns,
};

// Of one row of the table.
enum RowColumn
{
    // Displacement in the body frame and rotation in one substep.
    kRowX,
    kRowY,
    kRowCos,
    kRowSin,
    kRowMotion,
    kRowColumns = kRowMotion + kMotion,
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
    kCaught,
    kReached,
    kInside,
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
    int bits;              // of the table's rows; the tables of all robots have 2^bits
    const uint8_t *shown;  // by bit, of each robot: its target has the colour
    int vote_frames;       // majority over this many
    int kept_frames;       // of the sensor, newest included
    const BatchStep *steps;
    bool target_is_disc, errors;
    bool prefilters;  // one bit in single precision first; results are the same to the bit
    double most_m;    // that a robot may drive in a step
    double body_m;    // diameter; 0: no bodies
    double touch_m;   // nearer bodies count as in contact
    double step_s;
    DefenceWorld world;
    const uint8_t *bodies_shown;  // by bit, of each body of the world: it has the colour
    // Of all bodies of the world at the start, after the first substep, after the second, ...
    const PlainCapsule *places;
};

constexpr int kMostRows = 16;

// Numbers of one lane, in units of the lane count: columns, range, sums, bits seen, votes' ones,
// frames on the way, frames that vote, evaders caught. `total`: of two halves of a batch and their
// prefilter.
struct BatchLayout
{
    // Always inlined: see lanes.h on inline functions that are compiled for several processors.
    [[gnu::always_inline]] explicit BatchLayout(const BatchPlan &p)
        : first_row(kRobotColumns + p.bits * kBitColumns),
          range((first_row + (kRowColumns << p.bits)) * p.n),
          sums(range + 1),
          seen(sums + kBatchSums),
          ones(seen + p.bits * p.n),
          frames(ones + p.bits * p.n),
          votes(frames + p.kept_frames * p.bits * p.n),
          caught(votes + p.vote_frames * p.bits * p.n),
          size(caught + (p.world.body_count ? p.world.body_count + p.n : 0)),
          total(2 * size + kPrefilterColumns * p.n)
    {
    }
    [[gnu::always_inline]] int OfBit(int bit, int column) const
    {
        return kRobotColumns + bit * kBitColumns + column;
    }
    [[gnu::always_inline]] int OfRow(int row, int column) const
    {
        return first_row + row * kRowColumns + column;
    }
    int first_row, range, sums, seen, ones, frames, votes, caught, size, total;
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

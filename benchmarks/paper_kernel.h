// SPDX-License-Identifier: Apache-2.0
#ifndef BENCHMARKS_PAPER_KERNEL_H
#define BENCHMARKS_PAPER_KERNEL_H

constexpr int kPaperRobots = 6, kPaperLanes = 16;

struct PaperRobots
{
    float x[kPaperRobots][kPaperLanes], y[kPaperRobots][kPaperLanes];
    float c[kPaperRobots][kPaperLanes], s[kPaperRobots][kPaperLanes];
};

// Milling by the published equations and nothing else: single precision, 16 worlds, forward Euler,
// 0.25 m/s, 45 degrees/s, range 1.1 m, cone 49 degrees, 22 ms; as fast as this processor goes.
void RunPaperKernel(PaperRobots &robots, int steps);

#endif

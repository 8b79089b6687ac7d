// SPDX-License-Identifier: Apache-2.0
// The robot's decision on a frame, and a plain copy of the same frame, many times over.
#ifndef BENCHMARKS_DECISION_H
#define BENCHMARKS_DECISION_H

#include <stdint.h>

#define BENCH_WIDTH_PX 640
#define BENCH_HEIGHT_PX 480
#define BENCH_FRAME_BYTES (2 * BENCH_WIDTH_PX * BENCH_HEIGHT_PX)

// @param frames frame_count frames of BENCH_FRAME_BYTES, taken in turn, like a camera's buffers.
// @param bit_count the first so many of four colours anywhere: green, red, blue, yellow.
// @param seen how many of the decisions saw green, before the vote.
// @return ns of processor time that `count` decisions took; -1 if the core refuses its own default
// configuration.
int64_t bench_decide_ns(const uint8_t *frames, int frame_count, int bit_count, int count,
                        int *seen);

// @return ns of processor time that `count` calls of memcpy() took, into one and the same place.
int64_t bench_copy_ns(const uint8_t *frames, int frame_count, int count);

#endif

// SPDX-License-Identifier: Apache-2.0
// W numbers side by side, one world in each lane: the same arithmetic for one world and for many.
// All operations are those of IEEE 754, so a lane's result does not depend on W. Code in a file
// that is compiled for newer processors includes nothing beyond this and C headers: an inline
// function of the standard library, compiled there, could be linked into what runs everywhere.
#ifndef PLANT_LANES_H
#define PLANT_LANES_H

#include <stdint.h>
#ifdef __AVX512F__
#include <immintrin.h>
#endif

namespace twin
{

template <int W>
struct LaneTypes;

#define TWIN_LANE_TYPES(W)                                                    \
    template <>                                                               \
    struct LaneTypes<W>                                                       \
    {                                                                         \
        typedef double Real __attribute__((vector_size(8 * W), may_alias));   \
        typedef int64_t Mask __attribute__((vector_size(8 * W), may_alias));  \
        typedef uint64_t Bits __attribute__((vector_size(8 * W), may_alias)); \
    };
TWIN_LANE_TYPES(1)
TWIN_LANE_TYPES(2)
TWIN_LANE_TYPES(4)
TWIN_LANE_TYPES(8)
#undef TWIN_LANE_TYPES

template <int W>
struct Lanes
{
    using Real = typename LaneTypes<W>::Real;
    using Mask = typename LaneTypes<W>::Mask;  // of each lane all bits, or none
    using Bits = typename LaneTypes<W>::Bits;

    static Real All(double value) { return value - Real{}; }
    static Real Abs(Real a) { return (Real)((Mask)a & INT64_MAX); }
    static Real Min(Real a, Real b) { return b < a ? b : a; }
    static Real Max(Real a, Real b) { return a < b ? b : a; }
    static Real Sqrt(Real a)
    {
        for (int i = 0; i < W; ++i)
            a[i] = __builtin_sqrt(a[i]);
        return a;
    }
    static bool Any(Mask mask)
    {
#ifdef __AVX512F__
        if constexpr (W == 8)
            return _mm512_test_epi64_mask((__m512i)mask, (__m512i)mask) != 0;
#endif
        int64_t any = 0;
        for (int i = 0; i < W; ++i)
            any |= mask[i];
        return any != 0;
    }
    // 1 in the lanes of the mask, else 0.
    static Real One(Mask mask) { return mask ? All(1) : All(0); }
};

}  // namespace twin

#endif

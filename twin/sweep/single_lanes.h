// SPDX-License-Identifier: Apache-2.0
// As lanes.h, but 2 W numbers of single precision: as many bytes as W doubles.
#ifndef SWEEP_SINGLE_LANES_H
#define SWEEP_SINGLE_LANES_H

#include "plant/lanes.h"

namespace twin
{

template <int W>
struct SingleTypes;

#define TWIN_SINGLE_TYPES(W)                                                 \
    template <>                                                              \
    struct SingleTypes<W>                                                    \
    {                                                                        \
        typedef float Real __attribute__((vector_size(8 * W), may_alias));   \
        typedef int32_t Mask __attribute__((vector_size(8 * W), may_alias)); \
        typedef float Half __attribute__((vector_size(4 * W)));              \
        typedef int32_t HalfMask __attribute__((vector_size(4 * W)));        \
    };
TWIN_SINGLE_TYPES(2)
TWIN_SINGLE_TYPES(4)
TWIN_SINGLE_TYPES(8)
#undef TWIN_SINGLE_TYPES

template <int W>
struct SingleLanes
{
    using Real = typename SingleTypes<W>::Real;
    using Mask = typename SingleTypes<W>::Mask;
    using Double = typename Lanes<W>::Real;
    using DoubleMask = typename Lanes<W>::Mask;

    static Real All(float value) { return value - Real{}; }
    static Real Abs(Real a) { return (Real)((Mask)a & INT32_MAX); }
    static Real Max(Real a, Real b)
    {
#ifdef __AVX512F__
        if constexpr (W == 8)
            return (Real)_mm512_maskz_max_ps(kAll, (__m512)a, (__m512)b);
#endif
        return a < b ? b : a;
    }
    static Real Min(Real a, Real b)
    {
#ifdef __AVX512F__
        if constexpr (W == 8)
            return (Real)_mm512_maskz_min_ps(kAll, (__m512)a, (__m512)b);
#endif
        return b < a ? b : a;
    }
    // a * b + c, rounded once or twice.
    static Real MulAdd(Real a, Real b, Real c)
    {
#ifdef __AVX512F__
        if constexpr (W == 8)
            return (Real)_mm512_fmadd_ps((__m512)a, (__m512)b, (__m512)c);
#endif
        return a * b + c;
    }
    static bool Any(Mask mask) { return Lanes<W>::Any((DoubleMask)mask); }

    static Real Join(Double low, Double high)
    {
        const Half l = __builtin_convertvector(low, Half);
        const Half h = __builtin_convertvector(high, Half);
        if constexpr (W == 8)
            return __builtin_shufflevector(l, h, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14,
                                           15);
        else if constexpr (W == 4)
            return __builtin_shufflevector(l, h, 0, 1, 2, 3, 4, 5, 6, 7);
        else
            return __builtin_shufflevector(l, h, 0, 1, 2, 3);
    }
    static DoubleMask Low(Mask m) { return __builtin_convertvector(Part<0>(m), DoubleMask); }
    static DoubleMask High(Mask m) { return __builtin_convertvector(Part<W>(m), DoubleMask); }

private:
    // A mask, as without one gcc 12 warns of a source that is not used.
    static constexpr unsigned short kAll = 0xffff;
    using Half = typename SingleTypes<W>::Half;
    using HalfMask = typename SingleTypes<W>::HalfMask;

    template <int kFrom>
    static HalfMask Part(Mask m)
    {
        if constexpr (W == 8)
            return __builtin_shufflevector(m, m, kFrom, kFrom + 1, kFrom + 2, kFrom + 3, kFrom + 4,
                                           kFrom + 5, kFrom + 6, kFrom + 7);
        else if constexpr (W == 4)
            return __builtin_shufflevector(m, m, kFrom, kFrom + 1, kFrom + 2, kFrom + 3);
        else
            return __builtin_shufflevector(m, m, kFrom, kFrom + 1);
    }
};

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// Random bits, for one stream or for one in each lane of a vector. No headers, see plant/lanes.h.
#ifndef PLANT_SPLIT_MIX_H
#define PLANT_SPLIT_MIX_H

namespace twin
{

// The next 64 bits of the stream at `state`, which moves on: SplitMix64 (Steele, Lea and Flood
// 2014, "Fast splittable pseudorandom number generators"). Bits: uint64_t, or a vector of them.
template <class Bits>
[[gnu::always_inline]] inline Bits SplitMix(Bits &state)
{
    state += 0x9e3779b97f4a7c15u;
    Bits bits = (state ^ (state >> 30)) * 0xbf58476d1ce4e5b9u;
    bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebu;
    return bits ^ (bits >> 31);
}

}  // namespace twin

#endif

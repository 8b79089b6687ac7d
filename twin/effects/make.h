// SPDX-License-Identifier: Apache-2.0
// Shared by the effect files: turns an effect class into its catalogue entry's maker.
#ifndef EFFECTS_MAKE_H
#define EFFECTS_MAKE_H

#include <cmath>

#include "effects/effect.h"

namespace twin
{

template <class T>
std::unique_ptr<Effect> Make(std::span<const double> values)
{
    return std::make_unique<T>(values);
}

// True while a wheel rolls freely, slowed down by friction alone: its motor's lag does not act
// then, whichever of the two effects stands first in the model.
inline bool Rolls(const Signals &s, int wheel)
{
    return std::isfinite(s.max_decel_mps2[wheel]);
}

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// Shared by the effect files: turns an effect class into its catalogue entry's maker.
#ifndef EFFECTS_MAKE_H
#define EFFECTS_MAKE_H

#include "effects/effect.h"

namespace twin
{

template <class T>
std::unique_ptr<Effect> Make(std::span<const double> values)
{
    return std::make_unique<T>(values);
}

}  // namespace twin

#endif

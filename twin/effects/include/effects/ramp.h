// SPDX-License-Identifier: Apache-2.0
// A limit on how fast signals change, exact in steps of any length.
#ifndef EFFECTS_RAMP_H
#define EFFECTS_RAMP_H

#include "effects/signals.h"

namespace twin
{

constexpr int kRampState = 1 + 2 * kMaxWheels;

// Lets each of s.duty change by one in no less than pace_s; 0: as fast as it is told. `state` holds
// kRampState doubles.
void Ramp(DutySignals &s, const Wheels &pace_s, double *state);

}  // namespace twin

#endif

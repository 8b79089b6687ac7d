// SPDX-License-Identifier: Apache-2.0
// Whether a swarm's model says where its robots are, with all its formulas.
#ifndef SWARM_BOUNDS_H
#define SWARM_BOUNDS_H

#include <vector>

#include "swarm/swarm.h"

namespace twin
{

// Of one swarm, asked after each of its steps.
class Bounds
{
public:
    // Throws std::invalid_argument in one sentence if a robot is nowhere, or drives without a part
    // of its model.
    void Check(const Swarm &swarm);

private:
    std::vector<double> driven_s_;
};

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// What becomes of evaders: solid bodies that move, and robots of another colour than the first.
#ifndef SWEEP_DEFENCE_H
#define SWEEP_DEFENCE_H

#include <vector>

#include "swarm/swarm.h"
#include "sweep/cell.h"
#include "sweep/defence_lanes.h"

namespace twin
{

// The world's bodies at a time.
std::vector<PlainCapsule> PlacesAt(const std::vector<WorldBody> &world, double t_s);

// The world as DefenceFormulas take it.
class DefencePlan
{
public:
    explicit DefencePlan(const Cell &cell);
    DefenceWorld World() const;

private:
    std::vector<PlainBody> bodies_;
    std::vector<uint8_t> is_foe_;
    double robot_m_;
};

// Of sums over `steps` steps.
Defence DefenceOf(double caught_s, double reached_s, double inside, int steps);

// One world, watched step by step.
class DefenceWatch
{
public:
    explicit DefenceWatch(const Cell &cell);
    void Add(const Swarm &swarm);  // after a step
    Defence Sum() const;

private:
    const std::vector<WorldBody> &world_;
    DefencePlan plan_;
    std::vector<int64_t> caught_;  // these three of one lane
    std::vector<double> x_m_, y_m_;
    DefenceLanes<1> sums_;
    int steps_ = 0;
};

}  // namespace twin

#endif

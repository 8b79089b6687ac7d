// SPDX-License-Identifier: Apache-2.0
// From the model of a make of robots to the models of single ones.
#ifndef SWARM_ROBOTS_H
#define SWARM_ROBOTS_H

#include <cstdint>
#include <vector>

#include "fw/bit.h"
#include "fw/table.h"
#include "model_file/model.h"

namespace twin
{

// Robots 0..n-1 of `model`: theta_a1, theta_a2 drawn from N(1, std), range_m and cone_rad from
// N(mean, std), each from its robot's own stream; what [robots.Rnn] states is taken instead.
std::vector<Model> DrawRobots(const Model &model, int n, uint64_t seed);

// What the firmware of a robot looks for: the model's sensor.bits, which leave to its vote_frames
// what they do not state, effects included. Throws std::invalid_argument in one sentence.
std::vector<fw_bit> MakeBits(const Model &model);
// Throws std::invalid_argument in one sentence if a table needs more bits than that.
void CheckBits(const fw_table &table, size_t bit_count);

}  // namespace twin

#endif

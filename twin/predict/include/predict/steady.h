// SPDX-License-Identifier: Apache-2.0
// The steady motion that a constant input ends in: what a stopwatch and a tape measure show.
#ifndef PREDICT_STEADY_H
#define PREDICT_STEADY_H

#include <span>
#include <string>
#include <vector>

#include "model_file/model.h"

namespace twin
{

// Means over one second, after enough seconds from rest for every lag of the catalogue to pass.
constexpr int kSteadyValues =
    3 + kMaxWheels;  // vx_mps, vy_mps, omega_radps (body), rim speeds in m/s

// For each parameter vector and each command (K, 4; in the unit of the model's drive, duties
// -1..1) the steady values: (B, K, kSteadyValues). Row b of `values` (B, P) sets the quantities
// `names` of `model`; without names there is one row. The battery is at its nominal voltage.
std::vector<double> PredictSteady(const Model &model, std::span<const double> commands,
                                  const std::vector<std::string> &names,
                                  std::span<const double> values);

}  // namespace twin

#endif

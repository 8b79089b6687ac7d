// SPDX-License-Identifier: Apache-2.0
#include "predict/steady.h"

#include <algorithm>
#include <array>

#include "plant/planar_plant.h"

namespace twin
{
namespace
{

// The drive chain is exact over a step of any length; a step this long still follows a delay.
constexpr double kStep_s = 0.05;
constexpr int kSettle = 60, kMean = 20;  // steps: 3 s, then 1 s
constexpr int kDelay = 20;               // steps after which no delay is under way any more

using Values = std::array<double, kSteadyValues>;

Values Now(const RobotState &state)
{
    return {state.vx_mps,     state.vy_mps,     state.omega_radps, state.rim_mps[0],
            state.rim_mps[1], state.rim_mps[2], state.rim_mps[3]};
}

void WriteSteady(const DriveChain &chain, const double *command, double *out)
{
    Command held;
    std::copy_n(command, kMaxWheels, held.value.begin());
    RobotState state = chain.Start({});
    Values sum{}, now{};
    int steps = 0;
    for (int i = 0; i < kSettle + kMean; ++i)
    {
        PlanarStep(chain, held, i * kStep_s, kStep_s, state, nullptr);
        const Values before = now;
        now = Now(state);
        const bool settled = i > kDelay && now == before;
        if (i < kSettle && !settled)
            continue;
        ++steps;
        for (size_t k = 0; k < kSteadyValues; ++k)
            sum[k] += now[k];
        if (settled)
            break;
    }
    for (size_t k = 0; k < kSteadyValues; ++k)
        out[k] = sum[k] / steps;
}

}  // namespace

std::vector<double> PredictSteady(const Model &model, std::span<const double> commands,
                                  const std::vector<std::string> &names,
                                  std::span<const double> values)
{
    const size_t rows = names.empty() ? 1 : values.size() / names.size();
    const size_t count = commands.size() / kMaxWheels;
    std::vector<double> steady(rows * count * kSteadyValues);
    for (size_t b = 0; b < rows; ++b)
    {
        Model own = model;
        for (size_t p = 0; p < names.size(); ++p)
            own.Set(names[p], values[b * names.size() + p]);
        const DriveChain chain(own);
        for (size_t k = 0; k < count; ++k)
            WriteSteady(chain, &commands[k * kMaxWheels], &steady[(b * count + k) * kSteadyValues]);
    }
    return steady;
}

}  // namespace twin

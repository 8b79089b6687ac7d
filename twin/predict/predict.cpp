// SPDX-License-Identifier: Apache-2.0
#include "predict/predict.h"

#include <algorithm>

#include "playback.h"
#include "samples.h"

namespace twin
{
namespace
{

// Walks along the track and calls visit(k, sample, state) at each usable pose, with the robot moved
// to that time; the visitor restarts `state.pose` if it wants to.
template <class Visit>
void Walk(const DriveChain &chain, const Track &track, Random *random, Visit visit)
{
    RobotState state = chain.Start({});
    Playback playback(track);
    for (size_t k = 0; k < track.pose_t_s.size(); ++k)
    {
        if (track.segment[k] < 0)
            continue;
        const Sample sample = Measured(chain, track, k);
        playback.Advance(sample.t_s, [&](const Command &command, double t_s, double dt_s) {
            PlanarStep(chain, command, t_s, dt_s, state, random);
        });
        visit(k, sample, state);
    }
}

std::vector<double> OneStep(const DriveChain &chain, const Track &track)
{
    std::vector<double> predicted(track.pose.size(), kNaN);
    int64_t segment = -1;
    Walk(chain, track, nullptr, [&](size_t k, const Sample &sample, RobotState &state) {
        if (track.segment[k] == segment)
            WriteSeen(chain, state.pose, &predicted[3 * k]);
        segment = track.segment[k];
        state.pose = sample.pose;
    });
    return predicted;
}

}  // namespace

std::vector<double> PredictOneStep(const Model &model, const Track &track)
{
    return OneStep(DriveChain(model), track);
}

std::vector<double> SimulateReplica(const Model &model, const Track &track, uint64_t seed)
{
    const DriveChain chain(model);
    Random drive(seed, 0, "drive_noise"), sensor(seed, 0, "sensor_noise");
    std::vector<double> seen(track.pose.size(), kNaN);
    int64_t segment = -1;
    Walk(chain, track, &drive, [&](size_t k, const Sample &sample, RobotState &state) {
        if (track.segment[k] != segment)
            state.pose = sample.pose;
        segment = track.segment[k];
        double *out = &seen[3 * k];
        WriteSeen(chain, state.pose, out);
        out[0] += model.noise.sensor_m * sensor.Normal();
        out[1] += model.noise.sensor_m * sensor.Normal();
        out[2] += model.noise.sensor_rad * sensor.Normal();
    });
    return seen;
}

std::vector<double> PredictOneStepBatch(const Model &model, const Track &track,
                                        const std::vector<std::string> &names,
                                        std::span<const double> values)
{
    const auto chains = ChainsOf(model, names, values);
    std::vector<double> predicted(chains.size() * track.pose.size());
    InParallel(chains.size(), [&](size_t b) {
        const std::vector<double> one = OneStep(*chains[b], track);
        std::copy(one.begin(), one.end(),
                  predicted.begin() + static_cast<std::ptrdiff_t>(b * one.size()));
    });
    return predicted;
}

}  // namespace twin

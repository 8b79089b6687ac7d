// SPDX-License-Identifier: Apache-2.0
#include "predict/predict.h"

#include <atomic>
#include <cmath>
#include <limits>
#include <thread>

#include "playback.h"

namespace twin
{
namespace
{

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Sample
{
    Pose2 pose;  // of the robot's body
    double t_s;  // robot's clock
};

// Pose k as measured, taken back to the robot's own frame and clock.
Sample Measured(const DriveChain &chain, const Track &track, size_t k)
{
    Sample sample{{track.pose[3 * k], track.pose[3 * k + 1], track.pose[3 * k + 2]},
                  track.pose_t_s[k]};
    chain.Invert(sample.pose, sample.t_s);
    return sample;
}

// Writes the pose that motion capture would see of `pose`.
void WriteSeen(const DriveChain &chain, Pose2 pose, double *out)
{
    double unused_s = 0;
    chain.Observe(pose, unused_s);
    out[0] = pose.x_m;
    out[1] = pose.y_m;
    out[2] = pose.theta_rad;
}

// Walks along the track and calls visit(k, sample, state, playback) at each usable pose, with the
// robot moved to that time; the visitor restarts `state.pose` if it wants to.
template <class Visit>
void Walk(const DriveChain &chain, const Track &track, Random *random, Visit visit)
{
    RobotState state = chain.Start({});
    Playback playback(chain, track);
    for (size_t k = 0; k < track.pose_t_s.size(); ++k)
    {
        if (track.segment[k] < 0)
            continue;
        const Sample sample = Measured(chain, track, k);
        playback.Advance(sample.t_s, state, random);
        visit(k, sample, state, playback);
    }
}

}  // namespace

std::vector<double> PredictOneStep(const Model &model, const Track &track)
{
    const DriveChain chain(model);
    std::vector<double> predicted(track.pose.size(), kNaN);
    int64_t segment = -1;
    Walk(chain, track, nullptr,
         [&](size_t k, const Sample &sample, RobotState &state, const Playback &) {
             if (track.segment[k] == segment)
                 WriteSeen(chain, state.pose, &predicted[3 * k]);
             segment = track.segment[k];
             state.pose = sample.pose;
         });
    return predicted;
}

std::vector<double> PredictWindows(const Model &model, const Track &track,
                                   std::span<const int64_t> starts, std::span<const int64_t> ends)
{
    const DriveChain chain(model);
    const size_t horizons = starts.empty() ? 0 : ends.size() / starts.size();
    std::vector<double> predicted(3 * ends.size(), kNaN);
    size_t w = 0;
    Walk(chain, track, nullptr,
         [&](size_t k, const Sample &sample, RobotState &state, const Playback &playback) {
             state.pose = sample.pose;
             for (; w < starts.size() && static_cast<size_t>(starts[w]) == k; ++w)
             {
                 RobotState ahead = state;
                 Playback onward = playback;
                 for (size_t h = w * horizons; h < (w + 1) * horizons && ends[h] >= 0; ++h)
                 {
                     const auto end = static_cast<size_t>(ends[h]);
                     onward.Advance(Measured(chain, track, end).t_s, ahead, nullptr);
                     WriteSeen(chain, ahead.pose, &predicted[3 * h]);
                 }
             }
         });
    return predicted;
}

std::vector<double> SimulateReplica(const Model &model, const Track &track, uint64_t seed)
{
    const DriveChain chain(model);
    Random drive(seed, 0, "drive_noise"), sensor(seed, 0, "sensor_noise");
    std::vector<double> seen(track.pose.size(), kNaN);
    int64_t segment = -1;
    Walk(chain, track, &drive,
         [&](size_t k, const Sample &sample, RobotState &state, const Playback &) {
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
    const size_t rows = names.empty() ? 0 : values.size() / names.size();
    std::vector<Model> models(rows, model);
    for (size_t b = 0; b < rows; ++b)
        for (size_t p = 0; p < names.size(); ++p)
            models[b].Set(names[p], values[b * names.size() + p]);

    std::vector<double> predicted(rows * track.pose.size());
    std::atomic<size_t> next{0};
    const auto work = [&] {
        for (size_t b; (b = next++) < rows;)
        {
            const std::vector<double> one = PredictOneStep(models[b], track);
            std::copy(one.begin(), one.end(),
                      predicted.begin() + static_cast<std::ptrdiff_t>(b * one.size()));
        }
    };
    std::vector<std::jthread> threads;
    for (unsigned i = 1; i < std::min<size_t>(std::thread::hardware_concurrency(), rows); ++i)
        threads.emplace_back(work);
    work();
    threads.clear();
    return predicted;
}

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
// What all predictions share: measured poses as the robot's own, and many models at once.
#ifndef PREDICT_SAMPLES_H
#define PREDICT_SAMPLES_H

#include <atomic>
#include <exception>
#include <limits>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "predict/predict.h"

namespace twin
{

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Sample
{
    Pose2 pose;  // of the robot's body
    double t_s;  // robot's clock
};

// Pose k as measured, taken back to the robot's own frame and clock.
inline Sample Measured(const DriveChain &chain, const Track &track, size_t k)
{
    Sample sample{{track.pose[3 * k], track.pose[3 * k + 1], track.pose[3 * k + 2]},
                  track.pose_t_s[k]};
    chain.Invert(sample.pose, sample.t_s);
    return sample;
}

// Writes the pose that motion capture would see of `pose`.
inline void WriteSeen(const DriveChain &chain, Pose2 pose, double *out)
{
    double unused_s = 0;
    chain.Observe(pose, unused_s);
    out[0] = pose.x_m;
    out[1] = pose.y_m;
    out[2] = pose.theta_rad;
}

// Calls work(b) for each b below `count`, on all cores.
template <class Work>
void InParallel(size_t count, Work work)
{
    std::atomic<size_t> next{0};
    std::exception_ptr failed;
    std::mutex failing;
    const auto loop = [&] {
        try
        {
            for (size_t b; (b = next++) < count;)
                work(b);
        }
        catch (...)
        {
            const std::scoped_lock lock(failing);
            failed = std::current_exception();
        }
    };
    std::vector<std::jthread> threads;
    for (unsigned i = 1; i < std::min<size_t>(std::thread::hardware_concurrency(), count); ++i)
        threads.emplace_back(loop);
    loop();
    threads.clear();
    if (failed)
        std::rethrow_exception(failed);
}

// One robot per row of `values` (B, P), which sets the quantities `names` of `model`.
inline std::vector<std::shared_ptr<const DriveChain>> ChainsOf(
    Model model, const std::vector<std::string> &names, std::span<const double> values)
{
    std::vector<Parameter> bounds;
    std::vector<double *> places;
    for (const std::string &name : names)
    {
        bounds.push_back(model.Find(name));
        places.push_back(&model.At(name));
    }
    std::vector<std::shared_ptr<const DriveChain>> chains(
        names.empty() ? 0 : values.size() / names.size());
    for (auto &chain : chains)
    {
        for (size_t p = 0; p < names.size(); ++p)
        {
            bounds[p].CheckBounds(values[p], names[p]);
            *places[p] = values[p];
        }
        values = values.subspan(names.size());
        chain = std::make_shared<const DriveChain>(model);
    }
    return chains;
}

}  // namespace twin

#endif

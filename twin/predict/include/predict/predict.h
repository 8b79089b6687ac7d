// SPDX-License-Identifier: Apache-2.0
// Short predictions of a measured robot: the logged commands are played into the planar plant,
// restarted at measured poses.
#ifndef PREDICT_PREDICT_H
#define PREDICT_PREDICT_H

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "plant/planar_plant.h"

namespace twin
{

// How wheels moved along a track in calls of late, which most often serves the next call, too.
struct Plan;
struct Recording;
struct Recordings
{
    std::mutex held;
    std::shared_ptr<const Plan> last_plan;
    std::vector<std::shared_ptr<const Recording>> of_late;  // the latest used first
};

// A measured run of one robot; the arrays belong to the caller. Times ascend.
struct Track
{
    std::span<const double> command_t_s;  // (M), robot's clock
    std::span<const double> command;      // (M, 4), in the unit of the model's drive
    std::span<const double> battery_V;    // (M), NaN = not measured
    std::span<const double> pose_t_s;     // (N), capture's clock
    std::span<const double> pose;         // (N, 3): x_m, y_m, theta_rad of the marker body
    std::span<const int64_t> segment;  // (N), -1 = unusable; poses of one segment belong together
    Recordings *recordings = nullptr;  // kept from call to call; nullptr: none are
};

// For each pose the one predicted from the pose before it: (N, 3), NaN at the start of a segment.
std::vector<double> PredictOneStep(const Model &model, const Track &track);

// For each start (W, index of a pose) the poses predicted at `ends` (W, H; ascending indices, -1 =
// none): (W, H, 3), NaN where there is none. `starts` ascend.
std::vector<double> PredictWindows(const Model &model, const Track &track,
                                   std::span<const int64_t> starts, std::span<const int64_t> ends);

// The same for many parameter vectors, (B, W, H, 3), on all cores. Row b of `values` (B, P) sets
// the quantities `names` of `model`. With `part` (W) each window is predicted by the row of its
// number alone: (1, W, H, 3).
std::vector<double> PredictWindowsBatch(const Model &model, const Track &track,
                                        std::span<const int64_t> starts,
                                        std::span<const int64_t> ends,
                                        const std::vector<std::string> &names,
                                        std::span<const double> values,
                                        std::span<const int64_t> part = {});

// What predictions over windows are compared with, as it is seen from the start of each.
struct Displaced
{
    std::span<const double> start;     // (W, 3): x_m, y_m, theta_rad
    std::span<const double> measured;  // (W, H, 3): forward_m, left_m, turn_rad
    std::span<const double> weight;    // (W, H, 3)
};

// For many parameter vectors as above the weighted errors, measured less predicted and headings the
// short way round: (B, W, H, 3), 0 where nothing was measured or predicted.
std::vector<double> WindowErrorsBatch(const Model &model, const Track &track,
                                      std::span<const int64_t> starts,
                                      std::span<const int64_t> ends,
                                      const std::vector<std::string> &names,
                                      std::span<const double> values, const Displaced &displaced,
                                      std::span<const int64_t> part = {});

// What motion capture would have reported had this model driven: (N, 3), each segment started at
// its first measured pose, with the model's drive and sensor noise.
std::vector<double> SimulateReplica(const Model &model, const Track &track, uint64_t seed);

// One-step predictions for many parameter vectors, (B, N, 3), on all cores. Row b of `values` (B,
// P) sets the quantities `names` of `model`.
std::vector<double> PredictOneStepBatch(const Model &model, const Track &track,
                                        const std::vector<std::string> &names,
                                        std::span<const double> values);

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
#include "swarm/bounds.h"

#include <cmath>
#include <stdexcept>
#include <string>

namespace twin
{
namespace
{

// Further than any robot drives in the longest run: the model's numbers make it run away.
constexpr double kFarthest_m = 1e9;
// Below this, in m/s and rad/s, a robot stands.
constexpr double kStands = 1e-3;
// A formula that has no value at rest has one within this time of driving.
constexpr double kTried_s = 1;

}  // namespace

void Bounds::Check(const Swarm &swarm)
{
    driven_s_.resize(static_cast<size_t>(swarm.Size()));
    for (int robot = 0; robot < swarm.Size(); ++robot)
    {
        const RobotState &state = swarm.State(robot);
        const Pose2 &pose = state.pose;
        double &driven_s = driven_s_[static_cast<size_t>(robot)];
        driven_s += std::hypot(state.vx_mps, state.vy_mps, state.omega_radps) > kStands
                        ? swarm.PeriodS()
                        : 0;
        if (driven_s > kTried_s && swarm.IsSilent(robot))
            throw std::invalid_argument("robot " + std::to_string(robot) + " has driven for " +
                                        std::to_string(driven_s) +
                                        " s and a formula of its model has had no finite value; "
                                        "correct the formula");
        // NaN compares false.
        if (!(std::hypot(pose.x_m, pose.y_m) < kFarthest_m))
            throw std::invalid_argument(
                "robot " + std::to_string(robot) + " is out of any room after " +
                std::to_string(swarm.TimeS()) +
                " s: the model grows without bound; correct its formulas and numbers");
    }
}

}  // namespace twin

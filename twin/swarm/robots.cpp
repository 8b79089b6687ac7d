// SPDX-License-Identifier: Apache-2.0
#include "swarm/robots.h"

#include <algorithm>

#include "plant/random.h"

namespace twin
{
namespace
{

Model DrawRobot(const Model &model, int id, uint64_t seed)
{
    Model robot = model.ForRobot(id);
    const auto overrides = model.robot_overrides.find(id);
    const auto draw = [&](const char *key, double &value, double std, double min, double max,
                          Random &random) {
        const double drawn = std::clamp(value + std * random.Normal(), min, max);
        if (overrides == model.robot_overrides.end() || !overrides->second.contains(key))
            value = drawn;
    };
    Random drive(seed, id, "idiosyncrasy"), view(seed, id, "view");
    draw("theta_a1", robot.theta_a1, model.idiosyncrasy.theta_a1_std, 0.05, 5, drive);
    draw("theta_a2", robot.theta_a2, model.idiosyncrasy.theta_a2_std, 0.05, 5, drive);
    draw("range_m", robot.sensor.range_m, model.sensor.range_std_m, 0, 100, view);
    draw("cone_rad", robot.sensor.cone_rad, model.sensor.cone_std_rad, 0, 6.2832, view);
    return robot;
}

}  // namespace

std::vector<Model> DrawRobots(const Model &model, int n, uint64_t seed)
{
    std::vector<Model> robots;
    for (int id = 0; id < n; ++id)
        robots.push_back(DrawRobot(model, id, seed));
    return robots;
}

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
// The sensors that --sensor names.
#ifndef APP_SENSORS_H
#define APP_SENSORS_H

#include <cstdint>
#include <string>
#include <vector>

#include "model_file/model.h"
#include "swarm/camera_sensor.h"
#include "swarm/swarm.h"

namespace twin
{

std::vector<std::string> SensorNames();

// Gives each robot of the swarm the sensor of that name, one of SensorNames().
void UseSensor(const std::string &name, Swarm &swarm, const CameraWorld &world,
               const std::vector<Model> &robots, uint64_t seed);

}  // namespace twin

#endif

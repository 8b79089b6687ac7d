// SPDX-License-Identifier: Apache-2.0
#include "sensors.h"

#include <algorithm>
#include <memory>

#include "sensor/cone_sensor.h"
#include "swarm/robots.h"

namespace twin
{
namespace
{

// What a sensor may know of its robot.
struct Place
{
    const Model &robot;
    const CameraWorld &world;
    int number;
    uint64_t seed;
};

struct SensorKind
{
    const char *name;
    std::unique_ptr<RobotSensor> (*make)(const Place &);
};

constexpr SensorKind kSensors[] = {
    {"cone",
     [](const Place &at) -> std::unique_ptr<RobotSensor> {
         return std::make_unique<ConeSensor>(at.robot.MakeDetectionModel(), MakeBits(at.robot),
                                             at.number, at.seed);
     }},
    {"camera",
     [](const Place &at) -> std::unique_ptr<RobotSensor> {
         const DetectionModel detection = CameraDetectionModel(at.robot, at.world);
         return std::make_unique<CameraSensor>(at.world, at.number, detection, at.seed);
     }},
};

}  // namespace

std::vector<std::string> SensorNames()
{
    std::vector<std::string> names;
    for (const SensorKind &kind : kSensors)
        names.emplace_back(kind.name);
    return names;
}

void UseSensor(const std::string &name, Swarm &swarm, const CameraWorld &world,
               const std::vector<Model> &robots, uint64_t seed)
{
    const SensorKind &kind = *std::ranges::find(kSensors, name, &SensorKind::name);
    for (int i = 0; i < swarm.Size(); ++i)
        swarm.SetSensor(i, kind.make({robots[static_cast<size_t>(i)], world, i, seed}));
}

}  // namespace twin

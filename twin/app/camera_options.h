// SPDX-License-Identifier: Apache-2.0
// The part of twin_run's command line that is about cameras.
#ifndef APP_CAMERA_OPTIONS_H
#define APP_CAMERA_OPTIONS_H

#include <cstdint>
#include <string>

#include "swarm/camera_scenes.h"

namespace CLI
{
class App;
}

namespace twin
{

struct CameraOptions
{
    std::string target = "ball";
    int distractors = 0;
    double tilt_rad = 0;
};

void AddCameraOptions(CLI::App &app, CameraOptions &options);

// As words of a command line, each after a space.
std::string CameraWords(const CameraOptions &options);

// What all cameras see and share; distractors lie `ring_radius_m` away and beyond.
CameraWorld MakeCameraWorld(const CameraOptions &options, double ring_radius_m, uint64_t seed);

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// The part of twin_run's command line that is about hardware in the loop.
#ifndef APP_HIL_OPTIONS_H
#define APP_HIL_OPTIONS_H

#include <string>
#include <vector>

#include "fw/behavior.h"
#include "model_file/model.h"
#include "swarm/camera_sensor.h"
#include "swarm/swarm.h"

namespace CLI
{
class App;
}

namespace twin
{

struct HilOptions
{
    int robots = 0;  // robots 0 to robots-1 are driven by the program
    std::string program;
    bool free_run = false;
};

void AddHilOptions(CLI::App &app, HilOptions &options);

// As words of a command line, each after a space; none without such robots.
std::string HilWords(const HilOptions &options);

// Starts the programs. Throws std::runtime_error in one sentence.
void UseFirmware(Swarm &swarm, const HilOptions &options, const CameraWorld &world,
                 const std::vector<Model> &robots,
                 const std::vector<const fw_behavior *> &behaviors, uint64_t seed);

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
#include "camera_options.h"

#include <CLI/CLI.hpp>
#include <sstream>

namespace twin
{

void AddCameraOptions(CLI::App &app, CameraOptions &options)
{
    app.add_option("--target", options.target,
                   "what cameras look for: a green ball on a mast, or a cover over the deck")
        ->check(CLI::IsMember({"ball", "cover"}))
        ->capture_default_str();
    app.add_option("--distractors", options.distractors,
                   "coloured balls, none green, on the floor around the robots, for cameras only")
        ->check(CLI::Range(0, 1000))
        ->capture_default_str();
    app.add_option("--tilt-rad", options.tilt_rad, "how far cameras look down")
        ->check(CLI::Range(-0.9, 0.9))
        ->capture_default_str();
}

std::string CameraWords(const CameraOptions &options)
{
    std::ostringstream words;
    words << " --target " << options.target << " --distractors " << options.distractors
          << " --tilt-rad " << options.tilt_rad;
    return words.str();
}

CameraWorld MakeCameraWorld(const CameraOptions &options, double ring_radius_m, uint64_t seed)
{
    CameraWorld world;
    world.target = options.target == "cover" ? Target::kCover : Target::kBall;
    world.distractors = Distractors(options.distractors, ring_radius_m, seed);
    world.settings.tilt_rad = options.tilt_rad;
    return world;
}

}  // namespace twin

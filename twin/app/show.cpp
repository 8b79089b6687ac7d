// SPDX-License-Identifier: Apache-2.0
#include "show.h"

#include <cmath>
#include <numbers>

#include "fw/config.h"

namespace twin
{
namespace
{

// As wide as the picture, and as far as a ball on a mast covers more than the firmware's limit.
ViewCone CameraCone(double pan_rad)
{
    const CameraSettings settings;
    const Scene scene = RobotsSeenBy(1, std::vector<Pose2>(2), Target::kBall);
    const double limit_px = fw_config_default().min_blob_px, focal_px = settings.lens.focal_px;
    return {scene.balls.front().radius_m * focal_px * std::sqrt(std::numbers::pi / limit_px),
            2 * settings.lens.AngleRad(settings.width_px / 2.0 / focal_px), pan_rad};
}

}  // namespace

ViewOptions MakeViewOptions(const Options &options, const std::vector<Model> &robots)
{
    ViewOptions view{options.view, options.picture, options.video, FindModelFile(options.mjcf), {}};
    for (const Model &robot : robots)
    {
        const Sight sight = robot.MakeSight();
        view.cones.push_back(options.sensor == "camera"
                                 ? CameraCone(sight.pan_rad)
                                 : ViewCone{sight.range_m, sight.cone_rad, sight.pan_rad});
    }
    return view;
}

}  // namespace twin

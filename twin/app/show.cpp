// SPDX-License-Identifier: Apache-2.0
#include "show.h"

namespace twin
{

ViewOptions MakeViewOptions(const Options &options, const std::vector<Model> &robots)
{
    ViewOptions view{options.view, options.picture, options.video, FindModelFile(options.mjcf), {}};
    const CameraWorld world = MakeCameraWorld(options.camera, 0, 0);
    for (const Model &robot : robots)
    {
        const Sight sight =
            options.sensor == "camera" ? CameraSight(robot, world) : robot.MakeSight();
        view.cones.push_back({sight.range_m, sight.cone_rad, sight.pan_rad});
    }
    return view;
}

}  // namespace twin

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
        const DetectionModel detection = options.sensor == "camera"
                                             ? CameraDetectionModel(robot, world)
                                             : robot.MakeDetectionModel();
        view.cones.push_back({detection.range_m, detection.cone_rad, detection.pan_rad});
    }
    return view;
}

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "show.h"

namespace twin
{

Pictures::Pictures(const Options &options)
{
    if (!options.picture.empty())
        picture_.emplace("--picture", options.picture, options.force);
    if (!options.video.empty())
        video_.emplace("--video", options.video, options.force);
}

void Pictures::Finish()
{
    for (std::optional<NewFile> *file : {&picture_, &video_})
        if (*file)
            (*file)->Finish();
}

ViewOptions MakeViewOptions(const Options &options, const std::vector<Model> &robots,
                            const Pictures &pictures)
{
    ViewOptions view{
        options.view, pictures.Picture(), pictures.Video(), FindModelFile(options.mjcf), {}};
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

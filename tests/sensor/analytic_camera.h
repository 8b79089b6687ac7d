// SPDX-License-Identifier: Apache-2.0
// A pinhole camera by algebra instead of rays: what it sees of green balls, row by row, as exact
// intervals. Scenes are those of sensor/scene.h; all else is worked out anew.
#ifndef ANALYTIC_CAMERA_H
#define ANALYTIC_CAMERA_H

#include <vector>

#include "plant/plant.h"
#include "sensor/camera.h"
#include "sensor/scene.h"

namespace twin
{

struct Sighting
{
    double whole_px = 0;    // area of all green if nothing hid it
    double area_px = 0;     // of what is not hidden
    double largest_px = 0;  // of its largest connected part
    // The same with edges moved as below.
    double least_px = 0, most_px = 0;
};

// `edge_px`: how far the edge of a mask may lie from the true one. The least part is that of edges
// moved inward, the most part that of edges moved outward and parts joined across gaps of a pixel.
Sighting SeeGreen(const Scene &scene, const Pose2 &robot, const CameraSettings &settings,
                  double edge_px);

}  // namespace twin

#endif

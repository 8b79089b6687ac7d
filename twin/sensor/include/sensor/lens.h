// SPDX-License-Identifier: Apache-2.0
// Where a point ahead of the camera lands in its picture, and back.
#ifndef SENSOR_LENS_H
#define SENSOR_LENS_H

#include <array>

namespace twin
{

// A lens that is the same all around its axis, which meets the middle of the picture. An angle
// theta off the axis lands at the radius
//   pinhole    f tan(theta)
//   fisheye    f theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)
// (Kannala and Brandt 2006, as in OpenCV's fisheye module.)
struct Lens
{
    // The calibration that the maker ships with every TurboPi; its picture's middle, 32 and 21 px
    // off, is left out: it is of one specimen.
    double focal_px = 621;
    bool fisheye = true;
    std::array<double, 4> k{-0.0200, -0.1708, -0.2568, 0.9651};

    // Radius over focal length, of an angle off the axis below pi/2. It grows with the angle.
    double Radius(double theta_rad) const;
    // Its inverse.
    double AngleRad(double radius) const;
};

}  // namespace twin

#endif

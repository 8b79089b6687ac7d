// SPDX-License-Identifier: Apache-2.0
// Draws shapes, each in front of what lies behind it.
#ifndef CAMERA_CANVAS_H
#define CAMERA_CANVAS_H

#include <Eigen/Core>
#include <vector>

#include "sensor/camera.h"

namespace twin
{

// Coordinates are the camera's: x ahead along its axis, y left, z up.
class Camera::Canvas
{
public:
    explicit Canvas(const CameraSettings &settings);

    void DrawBall(const Eigen::Vector3d &centre_m, double radius_m, const Colour &colour);
    // `axes` are the columns of the box's own directions.
    void DrawBox(const Eigen::Vector3d &centre_m, const Eigen::Matrix3d &axes,
                 const Eigen::Vector3d &half_m, const Colour &colour);
    // The picture in YUYV; then the canvas is empty again.
    void Finish(std::vector<uint8_t> &yuyv);

private:
    // A pixel's ray is (1, left, up).
    struct Ray
    {
        float left, up;
    };
    // Pixels [first, last] in both directions.
    struct Window
    {
        int first_column, last_column, first_row, last_row;
    };
    struct Hit
    {
        double depth_m = 0, brightness = 0;  // no hit if the depth is not above zero
    };
    struct Span
    {
        int first, last;
    };

    void CastRays();
    void PaintBackground();
    Window Around(double least_left, double most_left, double least_up, double most_up) const;
    Window AroundBox(const Eigen::Vector3d &centre_m, const Eigen::Matrix3d &half_axes_m) const;
    template <class Shape>
    void Paint(const Window &window, const Colour &colour, const Shape &hit);
    void Join(int row, int column);

    CameraSettings settings_;
    std::vector<Ray> rays_;
    // Extremes of the rays of each column and row: they bound which pixels a shape may touch.
    std::vector<float> column_least_, column_most_, row_least_, row_most_;
    std::vector<Colour> background_, pixels_;
    std::vector<uint8_t> background_yuyv_;
    std::vector<float> depth_m_;
    std::vector<Span> painted_;  // of each row
};

}  // namespace twin

#endif

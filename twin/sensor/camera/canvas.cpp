// SPDX-License-Identifier: Apache-2.0
#include "canvas.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace twin
{
namespace
{

using Eigen::Vector3d;

constexpr float kFar = std::numeric_limits<float>::infinity();
constexpr double kNearest_m = 0.001;

Colour Shade(const Colour &colour, double brightness)
{
    const auto scale = [brightness](uint8_t value, int zero) {
        return static_cast<uint8_t>(std::lround(zero + brightness * (value - zero)));
    };
    return {scale(colour.y, 16), scale(colour.u, 128), scale(colour.v, 128)};
}

// Two pixels as a camera sends them.
void Pack(const Colour &a, const Colour &b, uint8_t *yuyv)
{
    yuyv[0] = a.y;
    yuyv[1] = static_cast<uint8_t>((a.u + b.u + 1) / 2);
    yuyv[2] = b.y;
    yuyv[3] = static_cast<uint8_t>((a.v + b.v + 1) / 2);
}

}  // namespace

Camera::Canvas::Canvas(const CameraSettings &settings)
    : settings_(settings),
      column_least_(static_cast<size_t>(settings.width_px), kFar),
      column_most_(static_cast<size_t>(settings.width_px), -kFar),
      row_least_(static_cast<size_t>(settings.height_px), kFar),
      row_most_(static_cast<size_t>(settings.height_px), -kFar),
      painted_(static_cast<size_t>(settings.height_px), Span{settings.width_px, -1})
{
    CastRays();
    PaintBackground();
    pixels_ = background_;
    depth_m_.assign(rays_.size(), kFar);
}

void Camera::Canvas::CastRays()
{
    const Lens &lens = settings_.lens;
    for (int row = 0; row < settings_.height_px; ++row)
        for (int column = 0; column < settings_.width_px; ++column)
        {
            const double right_px = column + 0.5 - settings_.width_px / 2.0;
            const double up_px = settings_.height_px / 2.0 - row - 0.5;
            const double off_px = std::hypot(right_px, up_px);
            const double stretch =
                off_px > 0 ? std::tan(lens.AngleRad(off_px / lens.focal_px)) / off_px : 0;
            const Ray ray{static_cast<float>(-stretch * right_px),
                          static_cast<float>(stretch * up_px)};
            rays_.push_back(ray);
            const size_t c = static_cast<size_t>(column), r = static_cast<size_t>(row);
            column_least_[c] = std::min(column_least_[c], ray.left);
            column_most_[c] = std::max(column_most_[c], ray.left);
            row_least_[r] = std::min(row_least_[r], ray.up);
            row_most_[r] = std::max(row_most_[r], ray.up);
        }
}

// A grey floor that brightens with the distance, and a pale wall beyond.
void Camera::Canvas::PaintBackground()
{
    const double c = std::cos(settings_.tilt_rad), s = std::sin(settings_.tilt_rad);
    for (const Ray &ray : rays_)
    {
        const double up = c * ray.up - s, ahead = c + s * ray.up;
        const double floor_m = up < 0 ? settings_.height_m * ahead / -up : kFar;
        const double luma = floor_m < 10 ? 105 + 40 * (1 - std::exp(-floor_m / 2)) : 180;
        background_.push_back({static_cast<uint8_t>(luma), 128, 128});
    }
    background_yuyv_.resize(2 * background_.size());
    for (size_t i = 0; i < background_.size(); i += 2)
        Pack(background_[i], background_[i + 1], &background_yuyv_[2 * i]);
}

// All pixels whose rays may lie within these bounds. Columns run from left to right, rows downward.
Camera::Canvas::Window Camera::Canvas::Around(double least_left, double most_left, double least_up,
                                              double most_up) const
{
    const auto first = [](const std::vector<float> &least, double most) {
        return static_cast<int>(
            std::partition_point(least.begin(), least.end(), [&](float v) { return v > most; }) -
            least.begin());
    };
    const auto last = [](const std::vector<float> &most, double least) {
        return static_cast<int>(std::partition_point(most.begin(), most.end(),
                                                     [&](float v) { return v >= least; }) -
                                most.begin()) -
               1;
    };
    return {first(column_least_, most_left), last(column_most_, least_left),
            first(row_least_, most_up), last(row_most_, least_up)};
}

void Camera::Canvas::Join(int row, int column)
{
    Span &span = painted_[static_cast<size_t>(row)];
    span = {std::min(span.first, column), std::max(span.last, column)};
}

template <class Shape>
void Camera::Canvas::Paint(const Window &window, const Colour &colour, const Shape &hit)
{
    for (int row = window.first_row; row <= window.last_row; ++row)
        for (int column = window.first_column; column <= window.last_column; ++column)
        {
            const size_t i = static_cast<size_t>(row * settings_.width_px + column);
            const Hit at = hit(rays_[i].left, rays_[i].up);
            if (!(at.depth_m > kNearest_m) || at.depth_m >= depth_m_[i])
                continue;
            depth_m_[i] = static_cast<float>(at.depth_m);
            pixels_[i] = Shade(colour, at.brightness);
            Join(row, column);
        }
}

// |t (1, l, u) - c| = r has the nearer solution t = (b - sqrt(b^2 - q d)) / q, where
// q = 1 + l^2 + u^2, b = (1, l, u) c, d = c^2 - r^2. Light comes from above.
void Camera::Canvas::DrawBall(const Vector3d &centre_m, double radius_m, const Colour &colour)
{
    const double d = centre_m.squaredNorm() - radius_m * radius_m;
    if (centre_m.x() < -radius_m || d <= 0)
        return;
    Window window{0, settings_.width_px - 1, 0, settings_.height_px - 1};
    if (centre_m.x() > radius_m)
    {
        const double x = centre_m.x(), w = x * x - radius_m * radius_m;
        const auto edge = [&](double v, int side) {
            return (v * x + side * radius_m * std::sqrt(v * v + w)) / w;
        };
        window = Around(edge(centre_m.y(), -1), edge(centre_m.y(), 1), edge(centre_m.z(), -1),
                        edge(centre_m.z(), 1));
    }
    Paint(window, colour, [&](double l, double u) -> Hit {
        const double q = 1 + l * l + u * u, b = centre_m.dot(Vector3d(1, l, u));
        const double root = b * b - q * d;
        if (root < 0)
            return {};
        const double t_m = (b - std::sqrt(root)) / q;
        return {t_m, 0.7 + 0.3 * (t_m * u - centre_m.z()) / radius_m};
    });
}

// The pixels that a box may touch; none if all its corners are beyond one edge of the picture.
Camera::Canvas::Window Camera::Canvas::AroundBox(const Vector3d &centre_m,
                                                 const Eigen::Matrix3d &half_axes_m) const
{
    constexpr double kInf = std::numeric_limits<double>::infinity();
    const double widest = column_most_.front(), highest = row_most_.front();
    double least_left = kInf, most_left = -kInf, least_up = kInf, most_up = -kInf;
    bool ahead = true;
    std::array<int, 5> beyond{};
    for (int corner = 0; corner < 8; ++corner)
    {
        const Vector3d at_m =
            centre_m +
            half_axes_m * Vector3d(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
        const double x = at_m.x(), y = at_m.y(), z = at_m.z();
        const std::array out{x<kNearest_m, y> widest * x, -y > widest * x, z > highest * x,
                             -z > highest * x};
        for (size_t k = 0; k < out.size(); ++k)
            beyond[k] += out[k];
        ahead = ahead && !out[0];
        least_left = std::min(least_left, y / x);
        most_left = std::max(most_left, y / x);
        least_up = std::min(least_up, z / x);
        most_up = std::max(most_up, z / x);
    }
    if (std::find(beyond.begin(), beyond.end(), 8) != beyond.end())
        return {0, -1, 0, -1};
    if (!ahead)
        return {0, settings_.width_px - 1, 0, settings_.height_px - 1};
    return Around(least_left, most_left, least_up, most_up);
}

// The ray is inside the box where it is inside all three slabs.
void Camera::Canvas::DrawBox(const Vector3d &centre_m, const Eigen::Matrix3d &axes,
                             const Vector3d &half_m, const Colour &colour)
{
    constexpr std::array kBrightness{0.85, 0.75, 1.0};
    const Vector3d centre = axes.transpose() * centre_m;
    Paint(AroundBox(centre_m, axes * half_m.asDiagonal()), colour, [&](double l, double u) -> Hit {
        double enter_m = -std::numeric_limits<double>::infinity(), leave_m = -enter_m;
        int side = 0;
        for (int k = 0; k < 3; ++k)
        {
            const double per_m = 1 / (axes(0, k) + l * axes(1, k) + u * axes(2, k));
            const double middle_m = centre[k] * per_m, reach_m = half_m[k] * std::abs(per_m);
            side = middle_m - reach_m > enter_m ? k : side;
            enter_m = std::max(enter_m, middle_m - reach_m);
            leave_m = std::min(leave_m, middle_m + reach_m);
        }
        return enter_m <= leave_m ? Hit{enter_m, kBrightness[static_cast<size_t>(side)]} : Hit{};
    });
}

void Camera::Canvas::Finish(std::vector<uint8_t> &yuyv)
{
    yuyv = background_yuyv_;
    for (size_t row = 0; row < painted_.size(); ++row)
    {
        Span &span = painted_[row];
        if (span.last < span.first)
            continue;
        const size_t begin = row * static_cast<size_t>(settings_.width_px);
        const size_t first = begin + static_cast<size_t>(span.first) / 2 * 2;
        const size_t end = begin + static_cast<size_t>(span.last) / 2 * 2 + 2;
        for (size_t i = first; i < end; i += 2)
            Pack(pixels_[i], pixels_[i + 1], &yuyv[2 * i]);
        const auto offset = [](size_t i) { return static_cast<std::ptrdiff_t>(i); };
        std::copy(background_.begin() + offset(first), background_.begin() + offset(end),
                  pixels_.begin() + offset(first));
        std::fill(depth_m_.begin() + offset(first), depth_m_.begin() + offset(end), kFar);
        span = {settings_.width_px, -1};
    }
}

}  // namespace twin

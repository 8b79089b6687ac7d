// SPDX-License-Identifier: Apache-2.0
#include "sensor/scene.h"

#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <stdexcept>

#include "plant/random.h"

namespace twin
{
namespace
{

using Eigen::Vector3d;

uint8_t Byte(double value)
{
    return static_cast<uint8_t>(std::lround(value));
}

// Parts of turbopi.xml, in the body frame.
struct Part
{
    Vector3d centre_m, half_m;
    Colour colour;
};

const Colour kGreen = Colour::FromRgb(0.10, 0.78, 0.20);
const Colour kGrey = Colour::FromRgb(0.55, 0.55, 0.55);
constexpr double kPlateHalf_m = 1e-3;
const Vector3d kBallAt_m{-0.035, 0, 0.18};
constexpr double kBallRadius_m = 0.02;

std::vector<Part> BodyParts()
{
    const Colour dark = Colour::FromRgb(0.13, 0.14, 0.16), rubber = Colour::FromRgb(0.1, 0.1, 0.11),
                 board = Colour::FromRgb(0.2, 0.22, 0.25), steel = Colour::FromRgb(0.6, 0.6, 0.6);
    std::vector<Part> parts{
        {{0.0015, 0, 0.0615}, {0.092, 0.047, 0.020}, dark},     // plates, battery and motors
        {{-0.035, 0, 0.0945}, {0.0425, 0.028, 0.013}, board},   // Raspberry Pi and driver board
        {{0.055, 0, 0.112}, {0.014, 0.0165, 0.024}, dark},      // camera on pan and tilt
        {{-0.035, 0, 0.134}, {0.0025, 0.0025, 0.028}, steel}};  // mast
    for (const double x : {0.059, -0.059})
        for (const double y : {0.067, -0.067})
            parts.push_back({{x, y, 0.0325}, {0.0325, 0.013, 0.0325}, rubber});
    return parts;
}

const Part kCover{{-0.035, 0, 0.129}, {0.050, 0.047, 0.020}, kGreen};

struct NamedColour
{
    const char *name;
    Colour colour;
};
const std::array<NamedColour, 5> kColours{{{"green", kGreen},
                                           {"red", Colour::FromRgb(0.85, 0.1, 0.1)},
                                           {"blue", Colour::FromRgb(0.1, 0.2, 0.85)},
                                           {"orange", Colour::FromRgb(0.9, 0.55, 0.1)},
                                           {"purple", Colour::FromRgb(0.6, 0.2, 0.7)}}};

}  // namespace

Colour Colour::FromRgb(double red, double green, double blue)
{
    const double luma = 0.299 * red + 0.587 * green + 0.114 * blue;
    return {Byte(16 + 219 * luma), Byte(128 + 224 * (blue - luma) / 1.772),
            Byte(128 + 224 * (red - luma) / 1.402)};
}

bool IsInside(const Colour &colour, const fw_color_box &box)
{
    return box.y_min <= colour.y && colour.y <= box.y_max && box.u_min <= colour.u &&
           colour.u <= box.u_max && box.v_min <= colour.v && colour.v <= box.v_max;
}

double TargetArea(Target target)
{
    if (target == Target::kBall)
        return std::numbers::pi * kBallRadius_m * kBallRadius_m;
    // A turned rectangle is as wide as its outline over pi, on average (Cauchy).
    return 4 * (kCover.half_m.x() + kCover.half_m.y()) / std::numbers::pi * 2 * kCover.half_m.z();
}

Colour TargetColour()
{
    return kGreen;
}

Colour ColourNamed(const std::string &name)
{
    std::string known;
    for (const NamedColour &named : kColours)
    {
        if (name == named.name)
            return named.colour;
        known += (known.empty() ? "" : ", ") + std::string(named.name);
    }
    throw std::invalid_argument("there is no colour '" + name + "'; choose one of " + known);
}

Scene RobotsSeenBy(size_t self, std::span<const Pose2> poses, Target target,
                   std::span<const double> target_scales, std::span<const Colour> colours)
{
    static const std::vector<Part> parts = BodyParts();
    Scene scene;
    for (size_t i = 0; i < poses.size(); ++i)
    {
        if (i == self)
            continue;
        const Pose2 &pose = poses[i];
        const double c = std::cos(pose.theta_rad), s = std::sin(pose.theta_rad);
        const auto in_world = [&](const Vector3d &p) {
            return Vector3d{pose.x_m + c * p.x() - s * p.y(), pose.y_m + s * p.x() + c * p.y(),
                            p.z()};
        };
        const auto add = [&](const Part &part) {
            scene.boxes.push_back(
                {in_world(part.centre_m), part.half_m, pose.theta_rad, part.colour});
        };
        for (const Part &part : parts)
            add(part);
        const Colour colour = colours.empty() ? kGreen : colours[i];
        const double scale = target_scales.empty() ? 1 : target_scales[i];
        if (scale == 0)
            continue;
        if (target == Target::kCover)
            add({kCover.centre_m, scale * kCover.half_m, colour});
        else
            scene.balls.push_back({in_world(kBallAt_m), scale * kBallRadius_m, colour});
    }
    return scene;
}

std::vector<Box> BoxesOf(const SeenBody &body, const Pose2 &eye)
{
    const Colour colour = body.colour.value_or(kGrey);
    const double half_height_m = body.height_m / 2, radius_m = body.shape.radius_m;
    std::vector<Box> boxes;
    const auto plate = [&](const Eigen::Vector2d &at_m) {
        const double dx_m = at_m.x() - eye.x_m, dy_m = at_m.y() - eye.y_m;
        const double distance2 = dx_m * dx_m + dy_m * dy_m;
        if (distance2 <= radius_m * radius_m)  // it stands in it: as over a goal on the floor
            return;
        const double half_m = radius_m * std::sqrt(distance2 / (distance2 - radius_m * radius_m));
        boxes.push_back({{at_m.x(), at_m.y(), half_height_m},
                         {kPlateHalf_m, half_m, half_height_m},
                         std::atan2(dy_m, dx_m),
                         colour});
    };
    plate(body.shape.from_m);
    const Eigen::Vector2d along_m = body.shape.to_m - body.shape.from_m;
    if (along_m.isZero())
        return boxes;
    plate(body.shape.to_m);
    const Eigen::Vector2d middle_m = (body.shape.from_m + body.shape.to_m) / 2;
    boxes.push_back({{middle_m.x(), middle_m.y(), half_height_m},
                     {along_m.norm() / 2, radius_m, half_height_m},
                     std::atan2(along_m.y(), along_m.x()),
                     colour});
    return boxes;
}

std::vector<Ball> Distractors(int count, double ring_radius_m, uint64_t seed)
{
    // All but the green.
    const std::span others = std::span(kColours).subspan<1>();
    std::vector<Ball> balls;
    for (int i = 0; i < count; ++i)
    {
        Random random(seed, i, "distractor");
        const double at_rad = 2 * std::numbers::pi * random.Uniform();
        const double out_m = ring_radius_m * (1 + 0.3 * random.Uniform());
        const double radius_m = 0.04 + 0.08 * random.Uniform();
        balls.push_back({{out_m * std::cos(at_rad), out_m * std::sin(at_rad), radius_m},
                         radius_m,
                         others[static_cast<size_t>(i) % others.size()].colour});
    }
    return balls;
}

}  // namespace twin

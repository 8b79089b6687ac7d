// SPDX-License-Identifier: Apache-2.0
#include "painter.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace twin
{
namespace
{

constexpr int kMaxGeoms = 20000;
constexpr int kFanSteps = 12;
constexpr double kFanHeight_m = 0.004;  // above the floor
constexpr double kFlat_m = 0.004;       // of a goal
constexpr float kSeen[4] = {0.15f, 0.85f, 0.3f, 0.35f}, kUnseen[4] = {0.95f, 0.6f, 0.15f, 0.22f};
constexpr int kCornerGap_px = 12, kCornerWidth_px = 320, kCornerHeight_px = 240;
constexpr double kNumberHeight_m = 0.29, kMarkRadius_m = 0.14, kMarkHalf_m = 0.001;
constexpr float kMark[4] = {1, 1, 1, 0.7f}, kNumber[4] = {1, 1, 1, 1};
constexpr double kRoom_m = 0.25;  // between a robot's middle and the edge of the picture
constexpr int kHullGroup = 3;     // what collides, in turbopi.xml

std::string Numbered(int robot)
{
    char name[16];
    std::snprintf(name, sizeof name, "R%02d", robot);
    return name;
}

// A triangle as MuJoCo draws it: two sides from a corner, and the normal.
void InitTriangle(mjvGeom *geom, const mjtNum a[3], const mjtNum b[3], const mjtNum c[3],
                  const float rgba[4])
{
    mjtNum sides[3][3], lengths[3], mat[9];
    mju_sub3(sides[0], b, a);
    mju_sub3(sides[1], c, a);
    mju_cross(sides[2], sides[0], sides[1]);
    for (int k = 0; k < 3; ++k)
    {
        lengths[k] = mju_normalize3(sides[k]);
        for (int row = 0; row < 3; ++row)
            mat[3 * row + k] = sides[k][row];
    }
    mjv_initGeom(geom, mjGEOM_TRIANGLE, lengths, a, mat, rgba);
    geom->category = mjCAT_DECOR;
}

// Every second pixel of a YUYV frame as RGB (BT.601), the lowest row first.
void HalveToRgb(const Image &picture, std::vector<uint8_t> &rgb)
{
    rgb.clear();
    const auto byte = [](double value) {
        return static_cast<uint8_t>(std::clamp(value, 0.0, 255.0));
    };
    for (int row = picture.height_px - 2; row >= 0; row -= 2)
        for (int pair = 0; pair < picture.width_px / 2; ++pair)
        {
            const uint8_t *p =
                picture.yuyv.data() + 2 * static_cast<size_t>(row * picture.width_px + 2 * pair);
            const double y = 1.164 * (p[0] - 16), u = p[1] - 128, v = p[3] - 128;
            rgb.push_back(byte(y + 1.596 * v));
            rgb.push_back(byte(y - 0.392 * u - 0.813 * v));
            rgb.push_back(byte(y + 2.017 * u));
        }
}

// As HalveToRgb does, of one colour.
void ToRgb(const Colour &colour, float rgb[3])
{
    const double y = 1.164 * (colour.y - 16), u = colour.u - 128, v = colour.v - 128;
    const double bytes[3] = {y + 1.596 * v, y - 0.392 * u - 0.813 * v, y + 2.017 * u};
    for (int i = 0; i < 3; ++i)
        rgb[i] = static_cast<float>(std::clamp(bytes[i] / 255, 0.0, 1.0));
}

// What the robot's table goes by: a vote of frames, and so a little later than what is in view.
std::string Acts(int robot, bool detected)
{
    return Numbered(robot) + (detected ? " acts on: seen" : " acts on: nobody seen");
}

// Whose middle is in its cone now, whatever stands between.
std::string InView(const Swarm &swarm, int robot, const ViewCone &cone)
{
    const Pose2 &own = swarm.State(robot).pose;
    std::string names;
    for (int i = 0; i < swarm.Size(); ++i)
    {
        const Pose2 &other = swarm.State(i).pose;
        const double x_m = other.x_m - own.x_m, y_m = other.y_m - own.y_m;
        const double off_rad = std::atan2(y_m, x_m) - own.theta_rad - cone.pan_rad;
        const bool inside = std::abs(std::remainder(off_rad, 2 * mjPI)) <= cone.angle_rad / 2;
        if (i != robot && inside && std::hypot(x_m, y_m) <= cone.range_m)
            names += ' ' + Numbered(i);
    }
    return "in view:" + (names.empty() ? " nobody" : names);
}

}  // namespace

Painter::Painter(Figures &figures, const std::vector<ViewCone> &cones)
    : figures_(figures), cones_(cones)
{
    mjv_defaultScene(&scene_);
    mjv_defaultCamera(&camera_);
    mjv_defaultOption(&option_);
    mjr_defaultContext(&context_);
    option_.geomgroup[kHullGroup] = 0;
    camera_.azimuth = 120;
    camera_.elevation = -42;
    mjv_makeScene(figures.model(), &scene_, kMaxGeoms);
    scene_.flags[mjRND_SHADOW] = 0;  // its map is too coarse for a whole swarm
    mjr_makeContext(figures.model(), &context_, mjFONTSCALE_100);
}

Painter::~Painter()
{
    mjr_freeContext(&context_);
    mjv_freeScene(&scene_);
}

// About the middle of the robots; never nearer than before, so that a video does not pump. Robots
// move without jumps, and so do middle and distance.
void Painter::Frame(const Swarm &swarm, const mjrRect &area)
{
    Pose2 low = swarm.State(0).pose, high = low;
    for (int i = 1; i < swarm.Size(); ++i)
    {
        const Pose2 &at = swarm.State(i).pose;
        low = {std::min(low.x_m, at.x_m), std::min(low.y_m, at.y_m), 0};
        high = {std::max(high.x_m, at.x_m), std::max(high.y_m, at.y_m), 0};
    }
    camera_.lookat[0] = (low.x_m + high.x_m) / 2;
    camera_.lookat[1] = (low.y_m + high.y_m) / 2;
    for (int i = 0; i < swarm.Size(); ++i)
        camera_.distance = std::max(camera_.distance,
                                    DistanceFor(swarm.State(i).pose.x_m - camera_.lookat[0],
                                                swarm.State(i).pose.y_m - camera_.lookat[1], area));
}

// How far off the camera must be for a robot there, from the point looked at, to be in the picture:
//
//   |across| <= tan(f / 2) aspect (distance + depth),    |up| <= tan(f / 2) (distance + depth)
//
// with the vertical field of view f; to the lower right, where the corner is, left of it or above.
double Painter::DistanceFor(double x_m, double y_m, const mjrRect &area) const
{
    const double azimuth_rad = camera_.azimuth * mjPI / 180,
                 elevation_rad = camera_.elevation * mjPI / 180;
    const double ahead_m = x_m * std::cos(azimuth_rad) + y_m * std::sin(azimuth_rad);
    const double across_m = x_m * std::sin(azimuth_rad) - y_m * std::cos(azimuth_rad);
    const double depth_m = ahead_m * std::cos(elevation_rad),
                 up_m = -ahead_m * std::sin(elevation_rad);
    const double half_up = std::tan(figures_.model()->vis.global.fovy * mjPI / 360);
    const double half_across = half_up * area.width / area.height;
    const auto distance_m = [&](double offset_m, double half) {
        return (std::abs(offset_m) + kRoom_m) / half - depth_m;
    };
    const double whole_m = std::max(distance_m(across_m, half_across), distance_m(up_m, half_up));
    if (across_m <= 0 || up_m >= 0)
        return whole_m;
    const double left_of = 1 - 2.0 * (kCornerWidth_px + kCornerGap_px) / area.width;
    const double above = 1 - 2.0 * (kCornerHeight_px + kCornerGap_px) / area.height;
    return std::max(whole_m, std::min(distance_m(across_m, half_across * left_of),
                                      distance_m(up_m, half_up * above)));
}

void Painter::AddCone(const RobotState &state, const ViewCone &cone, bool detected)
{
    const auto rim = [&](int step, mjtNum at[3]) {
        const double part = static_cast<double>(step) / kFanSteps - 0.5;
        const double angle_rad = state.pose.theta_rad + cone.pan_rad + cone.angle_rad * part;
        at[0] = state.pose.x_m + cone.range_m * std::cos(angle_rad);
        at[1] = state.pose.y_m + cone.range_m * std::sin(angle_rad);
        at[2] = kFanHeight_m;
    };
    const mjtNum tip[3] = {state.pose.x_m, state.pose.y_m, kFanHeight_m};
    for (int step = 0; step < kFanSteps; ++step)
    {
        mjtNum a[3], b[3];
        rim(step, a);
        rim(step + 1, b);
        if (mjvGeom *geom = NewDecor())
            InitTriangle(geom, tip, a, b, detected ? kSeen : kUnseen);
    }
}

// A post at each end, and for a wall what is between them; what robots drive over is flat.
void Painter::AddBody(const WorldBody &body, double t_s)
{
    const Capsule now = body.At(t_s);
    const double half_m = (body.is_solid ? body.height_m : kFlat_m) / 2;
    const Eigen::Vector2d along_m = now.to_m - now.from_m, middle_m = (now.from_m + now.to_m) / 2;
    float rgba[4] = {0.55f, 0.55f, 0.58f, 1};
    if (!body.colour.empty())
        ToRgb(ColourNamed(body.colour), rgba);
    const auto add = [&](int type, const Eigen::Vector2d &at_m, const mjtNum size[3],
                         const mjtNum *turned) {
        const mjtNum at[3] = {at_m.x(), at_m.y(), half_m};
        if (mjvGeom *geom = NewDecor())
        {
            mjv_initGeom(geom, type, size, at, turned, rgba);
            geom->category = mjCAT_DECOR;
        }
    };
    const mjtNum post[3] = {now.radius_m, half_m, 0};
    add(mjGEOM_CYLINDER, now.from_m, post, nullptr);
    const double length_m = along_m.norm();
    if (length_m == 0)
        return;
    add(mjGEOM_CYLINDER, now.to_m, post, nullptr);
    const double c = along_m.x() / length_m, s = along_m.y() / length_m;
    const mjtNum turned[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
    const mjtNum wall[3] = {length_m / 2, now.radius_m, half_m};
    add(mjGEOM_BOX, middle_m, wall, turned);
}

// Room for one more thing that is only looked at, or null.
mjvGeom *Painter::NewDecor()
{
    return scene_.ngeom < scene_.maxgeom ? &scene_.geoms[scene_.ngeom++] : nullptr;
}

// Its number above it; a white disc below the one whose camera is in the corner.
void Painter::AddNumber(const RobotState &state, int robot, bool is_in_corner)
{
    const mjtNum above[3] = {state.pose.x_m, state.pose.y_m, kNumberHeight_m};
    if (mjvGeom *geom = NewDecor())
    {
        mjv_initGeom(geom, mjGEOM_LABEL, nullptr, above, nullptr, kNumber);
        geom->category = mjCAT_DECOR;
        std::snprintf(geom->label, sizeof geom->label, "%s", Numbered(robot).c_str());
    }
    const mjtNum size[3] = {kMarkRadius_m, kMarkHalf_m, 0}, below[3] = {above[0], above[1], 0.006};
    if (mjvGeom *geom = is_in_corner ? NewDecor() : nullptr)
    {
        mjv_initGeom(geom, mjGEOM_CYLINDER, size, below, nullptr, kMark);
        geom->category = mjCAT_DECOR;
    }
}

void Painter::Draw(const Swarm &swarm, int robot_in_corner, const std::string &note,
                   const mjrRect &area)
{
    figures_.Place(swarm);
    camera_.type = mjCAMERA_FREE;
    mjv_updateScene(figures_.model(), figures_.data(), &option_, nullptr, &camera_, mjCAT_ALL,
                    &scene_);
    for (int i = 0; i < swarm.Size(); ++i)
    {
        AddCone(swarm.State(i), cones_[static_cast<size_t>(i)], swarm.Output(i).detected);
        AddNumber(swarm.State(i), i, i == robot_in_corner);
    }
    for (const WorldBody &body : swarm.World())
        AddBody(body, swarm.TimeS());
    mjr_render(area, &scene_, &context_);
    DrawCorner(swarm, robot_in_corner, area);
    char time[32];
    std::snprintf(time, sizeof time, "%.2f s", swarm.TimeS());
    mjr_overlay(mjFONT_NORMAL, mjGRID_TOPLEFT, area, time, note.c_str(), &context_);
}

// What the camera shows beside the cone that the sensor looks over, dark; `half_across` is the
// tangent of half its field of view.
void Painter::ShadeBeside(const ViewCone &cone, double half_across, const mjrRect &corner)
{
    const auto column_px = [&](double left_rad) {
        const double at_edge = std::atan(half_across);
        const double across = std::tan(std::clamp(left_rad, -at_edge, at_edge)) / half_across;
        return static_cast<int>(corner.width * (1 - across) / 2);
    };
    const int from = column_px(cone.pan_rad + cone.angle_rad / 2),
              to = column_px(cone.pan_rad - cone.angle_rad / 2);
    const mjrRect left{corner.left, corner.bottom, from, corner.height},
        right{corner.left + to, corner.bottom, corner.width - to, corner.height};
    for (const mjrRect &beside : {left, right})
        if (beside.width > 0)
            mjr_rectangle(beside, 0.1f, 0.1f, 0.12f, 0.7f);
}

// The frame that the firmware was given; for robots without one, what MuJoCo's camera shows.
void Painter::DrawCorner(const Swarm &swarm, int robot, const mjrRect &area)
{
    const Image picture = swarm.LastImage(robot);
    mjrRect corner{0, kCornerGap_px, kCornerWidth_px, kCornerHeight_px};
    if (!picture.yuyv.empty())
    {
        corner.width = picture.width_px / 2;
        corner.height = picture.height_px / 2;
    }
    corner.left = area.width - corner.width - kCornerGap_px;
    const int camera = figures_.CameraOf(robot);
    const ViewCone &cone = cones_[static_cast<size_t>(robot)];
    if (!picture.yuyv.empty())
    {
        HalveToRgb(picture, corner_rgb_);
        // The rectangle leaves the flat state that mjr_drawPixels needs after mjr_render.
        mjr_rectangle(corner, 0, 0, 0, 1);
        mjr_drawPixels(corner_rgb_.data(), nullptr, corner, &context_);
    }
    else if (camera >= 0)
    {
        mjvCamera view = camera_;
        view.type = mjCAMERA_FIXED;
        view.fixedcamid = camera;
        mjv_updateScene(figures_.model(), figures_.data(), &option_, nullptr, &view, mjCAT_ALL,
                        &scene_);
        mjr_render(corner, &scene_, &context_);
        const double half = std::tan(figures_.model()->cam_fovy[camera] * mjPI / 360);
        ShadeBeside(cone, half * corner.width / corner.height, corner);
    }
    std::string words = Acts(robot, swarm.Output(robot).detected);
    if (picture.yuyv.empty())
        words = InView(swarm, robot, cone) + '\n' + words;
    mjr_overlay(mjFONT_NORMAL, mjGRID_TOPLEFT, corner, words.c_str(), nullptr, &context_);
}

void Painter::UseOffscreen(int width_px, int height_px)
{
    if (context_.offWidth != width_px || context_.offHeight != height_px)
        mjr_resizeOffscreen(width_px, height_px, &context_);
    mjr_setBuffer(mjFB_OFFSCREEN, &context_);
}

void Painter::UseWindow()
{
    mjr_setBuffer(mjFB_WINDOW, &context_);
}

void Painter::Read(std::vector<uint8_t> &rgb, const mjrRect &area) const
{
    rgb.resize(3 * static_cast<size_t>(area.width) * static_cast<size_t>(area.height));
    mjr_readPixels(rgb.data(), nullptr, area, &context_);
}

}  // namespace twin

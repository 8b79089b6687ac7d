// SPDX-License-Identifier: Apache-2.0
#include "swarm/starts.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "plant/random.h"

namespace twin
{
namespace
{

constexpr double kPi = std::numbers::pi;
constexpr double kAuthorsBody_m = 0.2;
constexpr int kTriesPerRobot = 2000, kRestarts = 20;

struct Ground
{
    StartShape shape;
    double half_m;  // half side, or radius
    double apart_m;
};

Ground GroundFor(StartShape shape, int n, double spread_m, double body_radius_m)
{
    const double body_m = 2 * body_radius_m;
    if (shape != StartShape::kFacingOut)
        return {shape, spread_m / 2, body_m};
    const double apart_m = std::max(body_m, kAuthorsBody_m);
    return {shape, 2 * n * apart_m / (2 * kPi) + 0.1, apart_m};
}

Pose2 Draw(const Ground &ground, Random &random)
{
    Pose2 pose;
    if (ground.shape == StartShape::kSquare)
    {
        pose.x_m = ground.half_m * (2 * random.Uniform() - 1);
        pose.y_m = ground.half_m * (2 * random.Uniform() - 1);
    }
    else
    {
        const double radius_m = ground.half_m * std::sqrt(random.Uniform());
        const double at_rad = 2 * kPi * random.Uniform();
        pose.x_m = radius_m * std::cos(at_rad);
        pose.y_m = radius_m * std::sin(at_rad);
    }
    pose.theta_rad = ground.shape == StartShape::kFacingOut ? std::atan2(pose.y_m, pose.x_m)
                                                            : kPi * (2 * random.Uniform() - 1);
    return pose;
}

bool Free(const std::vector<Pose2> &taken, const Pose2 &pose, double apart_m)
{
    for (const Pose2 &other : taken)
        if (std::hypot(other.x_m - pose.x_m, other.y_m - pose.y_m) < apart_m)
            return false;
    return true;
}

bool IsClear(std::span<const WorldBody> world, const Pose2 &pose, double body_radius_m)
{
    const Eigen::Vector2d at_m{pose.x_m, pose.y_m};
    return std::ranges::none_of(world, [&](const WorldBody &body) {
        return body.is_solid &&
               (NearestPoint(body.shape, at_m) - at_m).norm() < body.shape.radius_m + body_radius_m;
    });
}

// Robot after robot takes the first free place it draws; none if one finds no place.
std::optional<std::vector<Pose2>> Place(const Ground &ground, std::vector<Random> &streams,
                                        std::span<const WorldBody> world)
{
    std::vector<Pose2> poses;
    for (Random &random : streams)
    {
        const size_t placed = poses.size();
        for (int attempt = 0; attempt < kTriesPerRobot && poses.size() == placed; ++attempt)
        {
            const Pose2 pose = Draw(ground, random);
            if (Free(poses, pose, ground.apart_m) && IsClear(world, pose, ground.apart_m / 2))
                poses.push_back(pose);
        }
        if (poses.size() == placed)
            return std::nullopt;
    }
    return poses;
}

}  // namespace

std::vector<Pose2> StartPoses(StartShape shape, int n, double spread_m, double body_radius_m,
                              uint64_t seed, std::span<const WorldBody> world)
{
    const Ground ground = GroundFor(shape, n, spread_m, body_radius_m);
    std::vector<Random> streams;
    for (int i = 0; i < n; ++i)
        streams.emplace_back(seed, i, "start");
    for (int restart = 0; restart < kRestarts; ++restart)
        if (const auto poses = Place(ground, streams, world))
            return *poses;
    std::ostringstream text;
    text << n << " robots of " << body_radius_m << " m radius do not fit into a start area "
         << 2 * ground.half_m << " m wide without overlap"
         << (world.empty() ? "" : ", the world's bodies left out")
         << ": raise --spread-m or lower --n";
    throw std::invalid_argument(text.str());
}

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "sweep/defence.h"

#include <cmath>
#include <limits>

namespace twin
{
namespace
{

constexpr double kNever_s = std::numeric_limits<double>::infinity();

double OrNone(double t_s)
{
    return std::isinf(t_s) ? std::numeric_limits<double>::quiet_NaN() : t_s;
}

}  // namespace

std::vector<PlainCapsule> PlacesAt(const std::vector<WorldBody> &world, double t_s)
{
    std::vector<PlainCapsule> places;
    for (const WorldBody &body : world)
        places.push_back(PlainOf(body.At(t_s)));
    return places;
}

DefencePlan::DefencePlan(const Cell &cell) : robot_m_(cell.model.robot.body_radius_m)
{
    for (const WorldBody &body : cell.world)
        bodies_.push_back({body.is_solid, body.is_solid && body.Moves()});
    for (size_t i = 0; i < cell.tables.size(); ++i)
        is_foe_.push_back(cell.ColourOf(i) != cell.ColourOf(0));
}

DefenceWorld DefencePlan::World() const
{
    return {static_cast<int>(is_foe_.size()),
            static_cast<int>(bodies_.size()),
            bodies_.data(),
            is_foe_.data(),
            robot_m_,
            kTouch};
}

Defence DefenceOf(double caught_s, double reached_s, double inside, int steps)
{
    return {OrNone(caught_s), OrNone(reached_s), inside / steps};
}

DefenceWatch::DefenceWatch(const Cell &cell)
    : world_(cell.world),
      plan_(cell),
      caught_(cell.world.size() + cell.tables.size()),
      x_m_(cell.tables.size()),
      y_m_(cell.tables.size()),
      sums_{Lanes<1>::All(kNever_s), Lanes<1>::All(kNever_s), {}}
{
}

void DefenceWatch::Add(const Swarm &swarm)
{
    if (world_.empty())
        return;
    for (size_t i = 0; i < x_m_.size(); ++i)
    {
        const Pose2 &pose = swarm.State(static_cast<int>(i)).pose;
        x_m_[i] = pose.x_m;
        y_m_[i] = pose.y_m;
    }
    using One = Lanes<1>;
    const auto column = [](std::vector<double> &values) {
        return reinterpret_cast<const One::Real *>(values.data());
    };
    const std::vector<PlainCapsule> places = PlacesAt(world_, swarm.TimeS());
    DefenceFormulas<1>::Add(plan_.World(), places.data(), column(x_m_), column(y_m_), swarm.TimeS(),
                            reinterpret_cast<One::Mask *>(caught_.data()), sums_);
    ++steps_;
}

Defence DefenceWatch::Sum() const
{
    return DefenceOf(sums_.caught_s[0], sums_.reached_s[0], sums_.inside[0], steps_);
}

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
// Fractions of seeds that mill, against an independent program of the published equations (C, 100
// or 1000 seeds a cell; "mills" = circliness below 0.2 over the last 10 of 120 s, started uniformly
// in a square of 1.2 m with random headings). Numbers, not code, were taken from it.
#include <gtest/gtest.h>

#include <cmath>

#include "paper_swarm.h"
#include "swarm/metrics.h"
#include "swarm/robots.h"
#include "swarm/starts.h"

namespace twin
{
namespace
{

constexpr int kSeeds = 150;

// The published integration: position with the heading before the step, one step a period.
class EulerPlant final : public Plant
{
public:
    EulerPlant(const std::vector<Model> &models, const std::vector<Pose2> &starts)
        : models_(models), states_(models.size()), commands_(models.size())
    {
        for (size_t i = 0; i < starts.size(); ++i)
            states_[i].pose = starts[i];
    }
    int Size() const override { return static_cast<int>(states_.size()); }
    void SetCommand(int robot, const Command &command) override
    {
        commands_[static_cast<size_t>(robot)] = command;
    }
    void Step(double dt_s) override
    {
        for (size_t i = 0; i < states_.size(); ++i)
        {
            RobotState &s = states_[i];
            s.vx_mps = models_[i].theta_a1 * commands_[i].value[0];
            s.omega_radps = models_[i].theta_a2 * commands_[i].value[2];
            s.pose.x_m += s.vx_mps * dt_s * std::cos(s.pose.theta_rad);
            s.pose.y_m += s.vx_mps * dt_s * std::sin(s.pose.theta_rad);
            s.pose.theta_rad += s.omega_radps * dt_s;
        }
        t_s_ += dt_s;
    }
    const RobotState &State(int robot) const override
    {
        return states_[static_cast<size_t>(robot)];
    }
    double TimeS() const override { return t_s_; }

private:
    std::vector<Model> models_;
    std::vector<RobotState> states_;
    std::vector<Command> commands_;
    double t_s_ = 0;
};

enum class Kind
{
    kPoint,
    kDisc,
    kRobot
};

struct Cell
{
    const char *name;
    Kind kind;
    bool euler;
    int n;
    double theta_std, period_s;
    double reference;  // fraction that mills
    int reference_seeds;
    double radius_m;  // of the mills, 0: not stated
};

// Euler: the literal text. The planar plant's exact arcs are compared with the reference's midpoint
// rule where the step matters, and with its Euler where it does not (disc and robot).
constexpr Cell kCells[] = {
    {"point_euler_n6_alike", Kind::kPoint, true, 6, 0, 0.022, 0.929, 1000, 0.319},
    {"point_euler_n6", Kind::kPoint, true, 6, 0.04, 0.022, 0.049, 1000, 0},
    {"point_euler_n7", Kind::kPoint, true, 7, 0.04, 0.022, 0.92, 100, 0},
    {"point_euler_n8", Kind::kPoint, true, 8, 0.04, 0.022, 0.70, 100, 0},
    {"point_euler_n10", Kind::kPoint, true, 10, 0.04, 0.022, 0.07, 100, 0},
    {"point_euler_n12", Kind::kPoint, true, 12, 0.04, 0.022, 0.00, 100, 0},
    {"point_arc_n6_alike", Kind::kPoint, false, 6, 0, 0.022, 0.83, 100, 0.319},
    {"point_arc_n6_alike_5ms", Kind::kPoint, false, 6, 0, 0.005, 0.65, 100, 0.319},
    {"disc_arc_n5", Kind::kDisc, false, 5, 0.04, 0.022, 0.98, 100, 0},
    {"disc_arc_n6_alike", Kind::kDisc, false, 6, 0, 0.022, 0.990, 1000, 1.095},
    {"disc_arc_n6", Kind::kDisc, false, 6, 0.04, 0.022, 0.978, 1000, 1.06},
    {"disc_arc_n7", Kind::kDisc, false, 7, 0.04, 0.022, 0.94, 100, 0},
    {"disc_arc_n8", Kind::kDisc, false, 8, 0.04, 0.022, 0.04, 100, 0},
    {"disc_arc_n9", Kind::kDisc, false, 9, 0.04, 0.022, 0.00, 100, 0},
    {"robot_arc_n6_alike", Kind::kRobot, false, 6, 0, 0.022, 0.967, 1000, 0.363},
    {"robot_arc_n6", Kind::kRobot, false, 6, 0.04, 0.022, 0.897, 1000, 0.359},
};

void PrintTo(const Cell &cell, std::ostream *out)
{
    *out << cell.name;
}

Model ModelOf(const Cell &cell)
{
    Model model = PaperModel();
    model.idiosyncrasy = {cell.theta_std, cell.theta_std};
    model.base.control_period_s = cell.period_s;
    if (cell.kind != Kind::kPoint)
        model.robot.body_radius_m = 0.1;
    if (cell.kind == Kind::kDisc)
        model.sensor.target_radius_m = 0.1;
    if (cell.kind == Kind::kRobot)
    {
        model.sensor.false_negative_rate = 0.04;
        model.sensor.false_positive_rate = 0.10;
        model.sensor.vote_frames = 10;
    }
    return model;
}

Metrics RunOne(const Cell &cell, uint64_t seed)
{
    const Model model = ModelOf(cell);
    const auto robots = DrawRobots(model, cell.n, seed);
    const auto starts = StartPoses(StartShape::kSquare, cell.n, 1.2, 0, seed);
    const auto tables = MillingTables(robots.size());
    Swarm swarm = cell.euler ? Swarm(std::make_unique<EulerPlant>(robots, starts), robots, tables,
                                     {.seed = seed})
                             : PlanarSwarm(robots, starts, tables, {.seed = seed});
    MetricWindow window(10);
    std::vector<RobotState> states(robots.size());
    while (swarm.TimeS() < 120)
    {
        swarm.Step();
        if (swarm.TimeS() < 110)
            continue;
        for (int i = 0; i < cell.n; ++i)
            states[static_cast<size_t>(i)] = swarm.State(i);
        window.Add(swarm.TimeS(), Measure(states, states.size(),
                                          {model.sensor.range_m, model.robot.body_radius_m}));
    }
    return window.Mean();
}

class Reference : public ::testing::TestWithParam<Cell>
{
};

TEST_P(Reference, MillsAsOftenAndAsWide)
{
    const Cell &cell = GetParam();
    int mills = 0;
    double radius_m = 0;
    for (uint64_t seed = 1; seed <= kSeeds; ++seed)
    {
        const Metrics mean = RunOne(cell, seed);
        if (!(mean.circliness < 0.2))
            continue;
        ++mills;
        radius_m += mean.radius_m;
        EXPECT_LT(mean.rotation, -0.95) << "every mill turns clockwise, seed " << seed;
    }
    // Both fractions are binomial samples: 3.5 standard deviations of their difference, with the
    // pooled fraction held off 0 and 1 by one success (Agresti and Coull 1998).
    const double ours = static_cast<double>(mills) / kSeeds, reference_n = cell.reference_seeds;
    const double pooled = (mills + cell.reference * reference_n + 1) / (kSeeds + reference_n + 2);
    const double sigma = std::sqrt(pooled * (1 - pooled) * (1.0 / kSeeds + 1 / reference_n));
    std::printf("%s: %.1f %% of %d, reference %.1f %% of %d (%+.1f sigma), radius %.3f m\n",
                cell.name, 100 * ours, kSeeds, 100 * cell.reference, cell.reference_seeds,
                (ours - cell.reference) / sigma, mills ? radius_m / mills : NAN);
    EXPECT_NEAR(ours, cell.reference, 3.5 * sigma);
    // The reference's own disc radius goes from 1.00 to 1.10 m with step and integration: 5 %.
    if (cell.radius_m > 0)
    {
        EXPECT_NEAR(radius_m / mills, cell.radius_m, 0.05 * cell.radius_m);
    }
}

INSTANTIATE_TEST_SUITE_P(Cells, Reference, ::testing::ValuesIn(kCells),
                         [](const auto &cell) { return std::string(cell.param.name); });

}  // namespace
}  // namespace twin

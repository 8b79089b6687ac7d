// SPDX-License-Identifier: Apache-2.0
// Swarms for Python: behaviours, worlds to their end, metrics and classes.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include "arrays.h"
#include "plant_mujoco/mujoco_plant.h"
#include "swarm/metrics.h"
#include "swarm/robots.h"
#include "swarm/species.h"
#include "swarm/world_file.h"
#include "sweep/batch.h"
#include "sweep/worlds.h"

using namespace nanobind::literals;

namespace twin
{
namespace
{

using Cube = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Seeds = nb::ndarray<const uint64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
// What a world's file lists.
struct Bodies
{
    std::vector<WorldBody> all;
};
using Row = std::vector<int>;  // speed and turn of each number of bits
using Tables = std::vector<Row>;

constexpr const char *kMetricNames[] = {"circliness", "radius_m",  "scatter_m2", "rotation",
                                        "odd_ratio",  "diffusion", "groups",     "contacts"};
constexpr size_t kMetrics = std::size(kMetricNames);
constexpr const char *kDefenceNames[] = {"caught_s", "reached_s", "inside"};

void Append(std::vector<double> &row, const Metrics &m)
{
    row.insert(row.end(), {m.circliness, m.radius_m, m.scatter_m2, m.rotation, m.odd_ratio,
                           m.diffusion, m.groups, m.contacts});
}

StartShape StartNamed(const std::string &name)
{
    if (name == "square")
        return StartShape::kSquare;
    if (name == "disc")
        return StartShape::kDisc;
    if (name == "facing-out")
        return StartShape::kFacingOut;
    throw std::invalid_argument("--start: there is no start '" + name +
                                "'; choose square, disc or facing-out");
}

fw_table TableOf(const Row &row)
{
    const auto entry = [&](size_t i) {
        constexpr int kOutside = FW_TURN_INPUT_MAX_MILLI + 1;
        return static_cast<int16_t>(std::clamp(row[i], -kOutside, kOutside));
    };
    fw_table table{};
    while (table.bit_count < FW_MAX_BITS && size_t{2} << table.bit_count < row.size())
        ++table.bit_count;
    const bool fits = size_t{2} << table.bit_count == row.size();
    for (size_t i = 0; fits && i < row.size() / 2; ++i)
        table.rows[i] = {entry(2 * i), entry(2 * i + 1)};
    if (!fits || fw_table_check(&table) != FW_OK)
        throw std::invalid_argument(
            "the firmware refuses a table: it has 2, 4, 8 or 16 rows; speed inputs are -100 to 100, "
            "turn inputs -2 to 2");
    return table;
}

Row RowOf(const fw_table &table)
{
    Row row;
    for (int i = 0; i < fw_table_row_count(&table); ++i)
        row.insert(row.end(), {table.rows[i].speed_input_pct, table.rows[i].turn_input_milli});
    return row;
}

using NamedTables = std::vector<std::pair<std::string, Row>>;

NamedTables Species(const std::string &text, std::optional<int> n, const NamedTables &own)
{
    std::vector<fw_behavior> behaviors;
    for (const auto &[name, row] : own)
        behaviors.push_back({name.c_str(), TableOf(row)});
    NamedTables robots;
    for (const fw_behavior *behavior : ParseSpecies(text, n, behaviors))
        robots.emplace_back(behavior->name, RowOf(behavior->table));
    return robots;
}

Cell MakeCell(const Model &model, const Tables &rows, size_t ring_size, const std::string &start,
              double spread_m, const std::vector<std::array<double, 3>> &poses,
              const std::vector<std::string> &colours, const std::vector<WorldBody> &world)
{
    if (!colours.empty() && colours.size() != rows.size())
        throw std::invalid_argument("colours must be none, or one for each table");
    if (!poses.empty() && poses.size() != rows.size())
        throw std::invalid_argument("poses must be none, or one for each table");
    if (ring_size < 1 || ring_size > rows.size())
        throw std::invalid_argument("ring_size must be 1 to the number of tables");
    std::vector<fw_table> tables;
    for (const auto &row : rows)
    {
        tables.push_back(TableOf(row));
        CheckBits(tables.back(), MakeBits(model).size());
    }
    std::vector<Pose2> starts;
    for (const auto &[x_m, y_m, theta_rad] : poses)
        starts.push_back({x_m, y_m, theta_rad});
    Cell cell{model, std::move(tables), ring_size, StartNamed(start), spread_m, std::move(starts)};
    for (const std::string &name : colours)
        cell.colours.push_back(ColourNamed(name));
    cell.world = world;
    return cell;
}

// Robots with other wheels than the installed one's are made of their models' numbers.
std::unique_ptr<Plant> MakeMujoco(const std::vector<Model> &models,
                                  const std::vector<Pose2> &starts, uint64_t seed,
                                  const std::vector<WorldBody> &world)
{
    const WheelKind wheels = models[0].base.wheels;
    const bool installed = wheels == WheelKind::kMecanum || wheels == WheelKind::kNone;
    MujocoOptions options = SweepOptions(seed);
    options.world = world;
    return std::make_unique<MujocoPlant>(installed ? FindModelFile("turbopi.xml") : "", models,
                                         starts, options);
}

void CheckPlant(const std::string &plant)
{
    if (plant != "planar" && plant != "mujoco")
        throw std::invalid_argument("plant '" + plant + "' must be 'planar' or 'mujoco'");
}

// (W, 10): the metrics, the least diffusion, and since when the class has held; (W, 13) with what
// became of evaders where a cell has a world.
Array Run(const std::vector<const Cell *> &cells, Indices cell, Seeds seeds, double duration_s,
          bool full, const std::string &plant)
{
    CheckPlant(plant);
    if (cell.size() != seeds.size())
        throw std::invalid_argument("cell and seeds must be as long as each other");
    std::vector<World> worlds;
    for (size_t w = 0; w < seeds.size(); ++w)
        worlds.push_back({cells.at(static_cast<size_t>(cell.data()[w])), seeds.data()[w]});
    const bool has_world =
        std::ranges::any_of(cells, [](const Cell *one) { return !one->world.empty(); });
    std::vector<double> rows;
    {
        nb::gil_scoped_release unlocked;
        for (const Outcome &o :
             plant == "mujoco" ? RunWorldsIn(MakeMujoco, worlds, duration_s)
                               : RunWorlds(worlds, duration_s, full ? Path::kFull : Path::kBest))
        {
            Append(rows, o.mean);
            rows.insert(rows.end(), {o.least_diffusion, o.settled_s});
            if (has_world)
                rows.insert(rows.end(),
                            {o.defence.caught_s, o.defence.reached_s, o.defence.inside});
        }
    }
    const size_t defence = has_world ? std::size(kDefenceNames) : 0;
    return ToNumpy(std::move(rows), {worlds.size(), kMetrics + 2 + defence});
}

Array Trace(const Cell &cell, uint64_t seed, double duration_s, double every_s,
            const std::string &plant)
{
    CheckPlant(plant);
    std::vector<double> poses;
    size_t times = 0;
    {
        nb::gil_scoped_release unlocked;
        for (const auto &at_once : TraceWorld(plant == "mujoco" ? MakeMujoco : MakePlanarBodies,
                                              {&cell, seed}, duration_s, every_s))
        {
            ++times;
            for (const Pose2 &pose : at_once)
                poses.insert(poses.end(), {pose.x_m, pose.y_m, pose.theta_rad});
        }
    }
    return ToNumpy(std::move(poses), {times, cell.tables.size(), 3});
}

nb::list TraceBodies(const Bodies &bodies, const std::vector<double> &t_s)
{
    nb::list all;
    for (const WorldBody &body : bodies.all)
    {
        std::vector<double> ends;
        for (const double at_s : t_s)
        {
            const PlainCapsule at = PlainOf(body.At(at_s));
            ends.insert(ends.end(), {at.from_x_m, at.from_y_m, at.to_x_m, at.to_y_m});
        }
        all.append(nb::make_tuple(body.name, body.colour, body.is_solid, body.shape.radius_m,
                                  ToNumpy(std::move(ends), {t_s.size(), size_t{4}})));
    }
    return all;
}

Array MeasureAll(Cube pose, Cube velocity, size_t ring_size, double range_m, double body_radius_m)
{
    const size_t times = pose.shape(0), n = pose.shape(1);
    if (pose.shape(2) != 3 || velocity.shape(0) != times || velocity.shape(1) != n ||
        velocity.shape(2) != 3 || ring_size < 1 || ring_size > n)
        throw std::invalid_argument("pose and velocity must be (T, n, 3), ring_size 1 to n");
    std::vector<double> rows;
    std::vector<RobotState> robots(n);
    for (size_t t = 0; t < times; ++t)
    {
        for (size_t i = 0; i < n; ++i)
        {
            const double *p = pose.data() + (t * n + i) * 3, *v = velocity.data() + (t * n + i) * 3;
            robots[i].pose = {p[0], p[1], p[2]};
            robots[i].vx_mps = v[0];
            robots[i].vy_mps = v[1];
            robots[i].omega_radps = v[2];
        }
        Append(rows, Measure(robots, ring_size, {range_m, body_radius_m}));
    }
    return ToNumpy(std::move(rows), {times, kMetrics});
}

std::vector<std::string> ClassifyAll(Matrix rows)
{
    if (rows.shape(1) < kMetrics)
        throw std::invalid_argument("rows must hold the metrics in the order of METRICS");
    std::vector<std::string> classes;
    for (size_t i = 0; i < rows.shape(0); ++i)
    {
        const double *m = rows.data() + i * rows.shape(1);
        classes.emplace_back(Classify({m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7]}));
    }
    return classes;
}

}  // namespace

void BindSwarms(nb::module_ &m)
{
    nb::list names, outcomes;
    for (const char *name : kMetricNames)
    {
        names.append(name);
        outcomes.append(name);
    }
    for (const char *name : {"least_diffusion", "settled_s"})
        outcomes.append(name);
    m.attr("METRICS") = names;
    m.attr("OUTCOMES") = outcomes;
    nb::list defence;
    for (const char *name : kDefenceNames)
        defence.append(name);
    m.attr("DEFENCE") = defence;
    m.attr("MUJOCO_PHYSICS") = std::string("MuJoCo ") + mj_versionString() + ", " + kSweepPhysics;
    m.def("species", &Species, "text"_a, "n"_a = nb::none(), "own"_a = NamedTables(),
          "Per robot the behaviour's name and (unseen speed, turn, seen speed, turn) inputs, turn "
          "in thousandths, or so for each number of k bits. `own`: tables beside the firmware's.");
    m.def("colours", &ColourNames, "text"_a, "n"_a = nb::none(),
          "Per robot the colour of its target, as name@colour says it.");
    nb::class_<Bodies>(m, "Bodies", "Obstacles, walls, goals and evaders of a world's file.")
        .def(
            "__init__",
            [](Bodies *self, const std::string &text, const std::string &origin) {
                new (self) Bodies{ParseWorld(text, origin)};
            },
            "text"_a, "origin"_a)
        .def_prop_ro(
            "goals",
            [](const Bodies &bodies) {
                std::vector<std::string> names;
                for (const WorldBody &body : bodies.all)
                    if (!body.is_solid)
                        names.push_back(body.name);
                return names;
            },
            "Names of what robots drive over.")
        .def("trace", &TraceBodies, "t_s"_a,
             "Of each body name, colour, whether it is solid, radius in m, and (T, 4) x and y of "
             "both ends.");
    nb::class_<Cell>(m, "Cell", "A swarm but for its seed; robots after ring_size are odd.")
        .def(
            "__init__",
            [](Cell *self, const Model &model, const Tables &tables, size_t ring_size,
               const std::string &start, double spread_m,
               const std::vector<std::array<double, 3>> &poses,
               const std::vector<std::string> &colours, const Bodies *world) {
                new (self) Cell(MakeCell(model, tables, ring_size, start, spread_m, poses, colours,
                                         world ? world->all : std::vector<WorldBody>()));
            },
            "model"_a, "tables"_a, "ring_size"_a, "start"_a = "square", "spread_m"_a = 1.2,
            "poses"_a = std::vector<std::array<double, 3>>(),
            "colours"_a = std::vector<std::string>(), "world"_a = nb::none())
        .def_prop_ro("period_s", [](const Cell &cell) { return cell.model.base.control_period_s; })
        .def_prop_ro("why_not_batched", [](const Cell &cell) { return WhyNotBatched(cell.model); });
    m.def(
        "run_worlds", &Run, "cells"_a, "cell"_a, "seeds"_a, "duration_s"_a, "full"_a = false,
        "plant"_a = "planar",
        "(W, 10) OUTCOMES of worlds of cell and seed: METRICS and their least diffusion over the last "
        "10 s; since when the class has held, NaN of the batched kernel. (W, 13) with DEFENCE where a "
        "cell has a world: when a robot first touched an evader, and an untouched evader was first "
        "in a goal, NaN if never; the share of the run for which an evader was in a goal.");
    m.def("trace_world", &Trace, "cell"_a, "seed"_a, "duration_s"_a, "every_s"_a,
          "plant"_a = "planar", "(T, n, 3) poses of one world, the start first.");
    m.def("measure", &MeasureAll, "pose"_a, "velocity"_a, "ring_size"_a, "range_m"_a,
          "body_radius_m"_a,
          "(T, 8) METRICS of (T, n, 3) poses and body velocities (vx, vy, omega).");
    m.def("classify", &ClassifyAll, "rows"_a, "Class of each row of mean METRICS.");
}

}  // namespace twin

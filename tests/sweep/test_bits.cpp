// SPDX-License-Identifier: Apache-2.0
// Every row of tables of 1 to 4 bits: what robot, twin and sweep make of the same bits.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "fw/mixing.h"
#include "swarm/camera_sensor.h"
#include "swarm/robots.h"
#include "swarm/swarm.h"
#include "sweep/batch.h"
#include "sweep/worlds.h"

namespace twin
{
namespace
{

const std::array<std::string, FW_MAX_BITS> kColours{"green", "red", "blue", "purple"};

// Whatever the light, and 12 counts of U and V on either side; blobs above 50 px.
std::string BitFor(const std::string &colour)
{
    const Colour c = ColourNamed(colour);
    return "all,0,255," + std::to_string(c.u - 12) + "," + std::to_string(c.u + 12) + "," +
           std::to_string(c.v - 12) + "," + std::to_string(c.v + 12) + ",50";
}

// Robot 0 decides by the table; of the others, one of each bit's colour, which stand, those whose
// bits are set are before it, side by side, and the rest behind.
Cell CellOf(int bits, int number)
{
    fw_table table{}, still{};
    table.bit_count = still.bit_count = static_cast<uint8_t>(bits);
    for (int row = 0; row < 1 << bits; ++row)
        table.rows[row] = {static_cast<int16_t>(5 * row - 40),
                           static_cast<int16_t>(90 * row - 700)};
    Cell cell{Model::Load("paper.toml"), {table}, static_cast<size_t>(bits) + 1};
    cell.model.sensor.bits.clear();
    cell.poses = {{0, 0, 0}};
    cell.colours = {ColourNamed("orange")};
    for (int bit = 0; bit < bits; ++bit)
    {
        const std::string &colour = kColours[static_cast<size_t>(bit)];
        cell.model.sensor.bits.push_back(BitFor(colour));
        cell.tables.push_back(still);
        cell.colours.push_back(ColourNamed(colour));
        cell.poses.push_back(number >> bit & 1 ? Pose2{0.7, 0.18 * bit - 0.27, 0}
                                               : Pose2{-3.0 - bit, 0, 0});
    }
    return cell;
}

fw_output FirmwareOn(const Cell &cell, uint32_t number)
{
    const std::vector<fw_bit> bits = MakeBits(cell.model);
    fw_config config = fw_config_default();
    config.bit_count = static_cast<int32_t>(bits.size());
    std::ranges::copy(bits, config.bits);
    config.table = cell.tables[0];
    fw_ctx robot;
    fw_output out;
    EXPECT_EQ(fw_init(&robot, &config), FW_OK);
    fw_step_bits(&robot, number, 0, 0, 0, &out);
    return out;
}

void ExpectSame(const fw_output &twin, const fw_output &robot, const char *what)
{
    EXPECT_EQ(twin.detected, robot.detected) << what;
    EXPECT_EQ(std::memcmp(twin.wheel_duty_pct, robot.wheel_duty_pct, FW_WHEEL_COUNT), 0) << what;
}

class Bits : public ::testing::TestWithParam<int>
{
};

TEST_P(Bits, GiveTheSameDutiesInFirmwareAndTwin)
{
    const int bits = GetParam();
    for (int number = 0; number < 1 << bits; ++number)
    {
        SCOPED_TRACE(number);
        const Cell cell = CellOf(bits, number);
        const fw_output robot = FirmwareOn(cell, static_cast<uint32_t>(number));
        int8_t mixed[FW_WHEEL_COUNT];
        fw_mix(&cell.tables[0].rows[number], mixed);
        EXPECT_EQ(std::memcmp(robot.wheel_duty_pct, mixed, sizeof mixed), 0);

        const std::vector<Model> models(cell.tables.size(), cell.model);
        Swarm swarm(MakePlanarBodies(models, cell.poses, 1), models, cell.tables,
                    {.colours = cell.colours});
        swarm.Decide();
        ExpectSame(swarm.Output(0), robot, "cone");
        const CameraWorld world;
        swarm.SetSensor(0, std::make_unique<CameraSensor>(
                               world, 0, CameraDetectionModel(cell.model, world), 1));
        swarm.Advance();
        swarm.Decide();
        ExpectSame(swarm.Output(0), robot, "camera");
    }
}

// A row moves the robot its own way: worlds end alike only if the rows are the same.
TEST_P(Bits, MoveTheSameInTwinAndSweep)
{
    const int bits = GetParam();
    std::vector<double> ends;
    for (int number = 0; number < 1 << bits; ++number)
    {
        SCOPED_TRACE(number);
        const Cell cell = CellOf(bits, number);
        ASSERT_EQ(WhyNotBatched(cell.model), "");
        const World world{&cell, 1};
        const double end_s = 4 * cell.model.base.control_period_s;
        const Metrics full = RunWorlds({&world, 1}, end_s, Path::kFull)[0].mean;
        const Metrics batched = RunWorlds({&world, 1}, end_s, Path::kBest)[0].mean;
        EXPECT_NEAR(batched.scatter_m2, full.scatter_m2, 1e-12);
        EXPECT_NEAR(batched.rotation, full.rotation, 1e-9);
        EXPECT_EQ(std::ranges::find(ends, full.scatter_m2), ends.end());
        ends.push_back(full.scatter_m2);
    }
}

INSTANTIATE_TEST_SUITE_P(OfOneToFour, Bits, ::testing::Range(1, FW_MAX_BITS + 1));

// Halves of the picture: a neighbour to the left sets the left bit alone, in cone and camera.
TEST(Sectors, AreHalvesOfTheView)
{
    Cell cell = CellOf(2, 0);
    cell.model.sensor.bits = {"left", "right"};
    cell.tables.resize(2);
    for (const auto &[y_m, number] : {std::pair{0.12, 1}, {-0.12, 2}, {2.0, 0}})
    {
        SCOPED_TRACE(y_m);
        const std::vector<Model> models(2, cell.model);
        Swarm swarm(MakePlanarBodies(models, {{0, 0, 0}, {0.6, y_m, 0}}, 1), models, cell.tables,
                    {});
        swarm.Decide();
        EXPECT_EQ(swarm.Output(0).detected, number);
        const CameraWorld world;
        swarm.SetSensor(0, std::make_unique<CameraSensor>(
                               world, 0, CameraDetectionModel(cell.model, world), 1));
        swarm.Advance();
        swarm.Decide();
        EXPECT_EQ(swarm.Output(0).detected, number);
    }
}

TEST(Tables, OfMoreBitsThanTheModelSeesAreRefused)
{
    Cell cell = CellOf(2, 0);
    cell.model.sensor.bits = {"all"};
    const std::vector<Model> models(cell.tables.size(), cell.model);
    EXPECT_THROW(Swarm(MakePlanarBodies(models, cell.poses, 1), models, cell.tables, {}),
                 std::invalid_argument);
}

}  // namespace
}  // namespace twin

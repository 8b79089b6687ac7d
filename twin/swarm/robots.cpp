// SPDX-License-Identifier: Apache-2.0
#include "swarm/robots.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "fw/table.h"
#include "plant/random.h"

namespace twin
{
namespace
{

// Draws two quantities around their model values, from a stream of their own.
struct Draw
{
    const char *key;
    double *value;
    double std, min, max;
};

void DrawPair(const char *stream, const std::array<Draw, 2> &pair, const Model &model, int id,
              uint64_t seed)
{
    if (pair[0].std == 0 && pair[1].std == 0)
        return;
    Random random(seed, id, stream);
    const auto stated = model.robot_overrides.find(id);
    for (const Draw &draw : pair)
    {
        const double drawn = *draw.value + draw.std * random.Normal();
        if (stated == model.robot_overrides.end() || !stated->second.contains(draw.key))
            *draw.value = std::clamp(drawn, draw.min, draw.max);
    }
}

Model DrawRobot(const Model &model, int id, uint64_t seed)
{
    Model robot = model.ForRobot(id);
    const Idiosyncrasy &drive = model.idiosyncrasy;
    const Sensor &view = model.sensor;
    DrawPair("idiosyncrasy",
             {{{"theta_a1", &robot.theta_a1, drive.theta_a1_std, 0.05, 5},
               {"theta_a2", &robot.theta_a2, drive.theta_a2_std, 0.05, 5}}},
             model, id, seed);
    DrawPair("view",
             {{{"range_m", &robot.sensor.range_m, view.range_std_m, 0, 100},
               {"cone_rad", &robot.sensor.cone_rad, view.cone_std_rad, 0, 6.2832}}},
             model, id, seed);
    return robot;
}

}  // namespace

std::vector<Model> DrawRobots(const Model &model, int n, uint64_t seed)
{
    std::vector<Model> robots;
    robots.reserve(static_cast<size_t>(n));
    for (int id = 0; id < n; ++id)
        robots.push_back(DrawRobot(model, id, seed));
    return robots;
}

void CheckBits(const fw_table &table, size_t bit_count)
{
    if (table.bit_count > bit_count)
        throw std::invalid_argument("a table of " + std::to_string(fw_table_row_count(&table)) +
                                    " rows needs " + std::to_string(table.bit_count) +
                                    " bits, and the model has " + std::to_string(bit_count) +
                                    ": list them in its sensor.bits, as in [\"left\", \"right\"]");
}

std::vector<fw_bit> MakeBits(const Model &model)
{
    if (model.sensor.bits.size() > FW_MAX_BITS)
        throw std::invalid_argument("sensor.bits has " + std::to_string(model.sensor.bits.size()) +
                                    " entries: at most " + std::to_string(FW_MAX_BITS));
    std::vector<fw_bit> bits;
    for (const std::string &text : model.sensor.bits)
    {
        fw_bit bit = fw_bit_default();
        bit.vote.max_frames =
            static_cast<int32_t>(std::lround(model.MakeDetectionModel().vote_frames));
        if (!fw_bit_parse(text.c_str(), &bit))
            throw std::invalid_argument(
                "sensor.bits: '" + text +
                "' must be all, left or right, and what differs of "
                "y_min,y_max,u_min,u_max,v_min,v_max,min_blob_px,vote_frames,vote_window_ms");
        bits.push_back(bit);
    }
    return bits;
}

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
#include "swarm/world_file.h"

#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "sensor/scene.h"

namespace twin
{
namespace
{

using Eigen::Vector2d;

constexpr double kLargest_m = 1000, kFastest_mps = 10;
// A wall's half thickness, and the height of all bodies: above the cameras' (turbopi.xml).
constexpr double kWallRadius_m = 0.02, kHeight_m = 0.2;
constexpr const char *kKeys[] = {"name",     "at_m",   "from_m", "to_m",   "radius_m",
                                 "height_m", "colour", "solid",  "path_m", "speed_mps"};

// One [[body]].
class Reader
{
public:
    Reader(const std::string &file, const toml::table &table, size_t number)
        : table_(table), origin_(file + ", body " + std::to_string(number))
    {
    }

    WorldBody Read() const
    {
        for (const auto &[key, value] : table_)
            if (std::ranges::find(kKeys, key.str()) == std::end(kKeys))
                Fail("there is no key '" + std::string(key.str()) + "'");
        const bool is_disc = table_.contains("at_m");
        if (is_disc == (table_.contains("from_m") && table_.contains("to_m")))
            Fail("give at_m of a disc, or from_m and to_m of a wall");
        WorldBody body;
        body.name = Text("name");
        body.shape.from_m = Point(is_disc ? "at_m" : "from_m", table_);
        body.shape.to_m = is_disc ? body.shape.from_m : Point("to_m", table_);
        const std::optional<double> thin = is_disc ? std::nullopt : std::optional(kWallRadius_m);
        body.shape.radius_m = Number("radius_m", 1e-3, kLargest_m, thin);
        body.height_m = Number("height_m", 1e-3, kLargest_m, kHeight_m);
        body.colour = Text("colour");
        if (!body.colour.empty())
            CheckColour(body.colour);
        body.is_solid = Flag("solid", true);
        ReadPath(body);
        return body;
    }

private:
    [[noreturn]] void Fail(const std::string &why) const
    {
        throw std::invalid_argument(origin_ + ": " + why);
    }

    std::string Text(const char *key) const
    {
        if (!table_.contains(key))
            return "";
        const auto text = table_[key].value<std::string>();
        if (!text)
            Fail(std::string(key) + " must be a text");
        return *text;
    }

    bool Flag(const char *key, bool usual) const
    {
        if (!table_.contains(key))
            return usual;
        const auto flag = table_[key].value_exact<bool>();
        if (!flag)
            Fail(std::string(key) + " must be true or false");
        return *flag;
    }

    double Number(const char *key, double least, double most, std::optional<double> usual) const
    {
        if (!table_.contains(key) && usual)
            return *usual;
        const auto number = table_[key].value<double>();
        if (!number || !(*number >= least && *number <= most))
            Fail(std::string(key) + " must be a number from " + Short(least) + " to " +
                 Short(most));
        return *number;
    }

    template <class Node>
    Vector2d Point(const char *key, const Node &node) const
    {
        const toml::array *pair = nullptr;
        if constexpr (std::is_same_v<Node, toml::table>)
            pair = node[key].as_array();
        else
            pair = node.as_array();
        Vector2d point;
        for (size_t i = 0; i < 2; ++i)
        {
            const auto number =
                pair && pair->size() == 2 ? (*pair)[i].template value<double>() : std::nullopt;
            if (!number || !(std::abs(*number) <= kLargest_m))
                Fail(std::string(key) + " must be two numbers, x and y, of at most " +
                     Short(kLargest_m) + " m");
            point[static_cast<Eigen::Index>(i)] = *number;
        }
        return point;
    }

    void ReadPath(WorldBody &body) const
    {
        if (table_.contains("path_m") != table_.contains("speed_mps"))
            Fail("give path_m and speed_mps of what moves, or neither");
        if (!table_.contains("path_m"))
            return;
        const toml::array *points = table_["path_m"].as_array();
        if (!points || points->empty())
            Fail("path_m must be a list of points, as [[0, 0], [1, 0]]");
        for (const toml::node &point : *points)
            body.path_m.push_back(Point("path_m", point));
        body.speed_mps = Number("speed_mps", 0, kFastest_mps, std::nullopt);
    }

    void CheckColour(const std::string &colour) const
    {
        try
        {
            ColourNamed(colour);
        }
        catch (const std::invalid_argument &error)
        {
            Fail(error.what());
        }
    }

    static std::string Short(double number)
    {
        char text[32];
        std::snprintf(text, sizeof text, "%g", number);
        return text;
    }

    const toml::table &table_;
    std::string origin_;
};

toml::table TableOf(const std::string &text, const std::string &origin)
{
    try
    {
        return toml::parse(text, origin);
    }
    catch (const toml::parse_error &error)
    {
        throw std::invalid_argument(origin + ", line " + std::to_string(error.source().begin.line) +
                                    ": " + std::string(error.description()));
    }
}

}  // namespace

std::vector<WorldBody> LoadWorld(const std::string &path)
{
    if (path.empty())
        return {};
    std::ostringstream text;
    if (!(text << std::ifstream(path, std::ios::binary).rdbuf()))
        throw std::invalid_argument(path + ": cannot be read, or is empty");
    return ParseWorld(text.str(), path);
}

std::vector<WorldBody> ParseWorld(const std::string &text, const std::string &origin)
{
    std::vector<WorldBody> world;
    const toml::table file = TableOf(text, origin);
    const toml::array *bodies = file["body"].as_array();
    if (!bodies || file.size() != 1)
        throw std::invalid_argument(origin + ": must be a list of [[body]], and nothing else");
    for (const toml::node &node : *bodies)
    {
        if (!node.is_table())
            throw std::invalid_argument(origin + ": must be a list of [[body]], and nothing else");
        world.push_back(Reader(origin, *node.as_table(), world.size() + 1).Read());
        if (world.back().name.empty())
            world.back().name = "body" + std::to_string(world.size());
    }
    return world;
}

}  // namespace twin

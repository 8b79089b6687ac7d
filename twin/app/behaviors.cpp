// SPDX-License-Identifier: Apache-2.0
#include "behaviors.h"

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <stdexcept>

#include "toml_file.h"

namespace twin
{
namespace
{

namespace fs = std::filesystem;

constexpr const char *kFileName = "behaviors.toml";

std::string DefaultFile()
{
    const char *config = std::getenv("XDG_CONFIG_HOME"), *home = std::getenv("HOME");
    fs::path user = config && *config ? fs::path(config) : fs::path(home ? home : "") / ".config";
    for (const fs::path &path : {fs::path(kFileName), user / "twinmill" / kFileName})
        if (fs::is_regular_file(path))
            return path.string();
    return "";
}

}  // namespace

std::string FindBehaviors(const std::string &path)
{
    return path.empty() ? DefaultFile() : path;
}

OwnBehaviors::OwnBehaviors(const std::string &path)
{
    const std::string file = FindBehaviors(path);
    if (file.empty())
        return;
    for (const auto &[key, value] : ParseToml(file))
    {
        const std::optional<std::string> text = value.value<std::string>();
        fw_table table;
        if (!text || !fw_table_parse(text->c_str(), &table))
            throw std::invalid_argument(
                file + ": '" + std::string(key.str()) +
                "' must be \"speed,turn,speed,turn\", for nothing seen and for seen, as in "
                "\"100,-0.5,100,0.5\" (speed -100 to 100, turn -2 to 2), or 4, 8 or 16 such pairs");
        names_.emplace_back(key.str());
        behaviors_.push_back({names_.back().c_str(), table});
    }
}

}  // namespace twin

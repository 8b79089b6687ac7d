// SPDX-License-Identifier: Apache-2.0
#include "toml_file.h"

#include <stdexcept>

namespace twin
{

toml::table ParseToml(const std::string &path)
{
    try
    {
        return toml::parse_file(path);
    }
    catch (const toml::parse_error &error)
    {
        throw std::invalid_argument(path + ", line " + std::to_string(error.source().begin.line) +
                                    ": " + std::string(error.description()));
    }
}

}  // namespace twin

// SPDX-License-Identifier: Apache-2.0
// Reads a TOML file of the user's.
#ifndef APP_TOML_FILE_H
#define APP_TOML_FILE_H

#include <toml++/toml.h>

#include <string>

namespace twin
{

// Throws std::invalid_argument in one sentence, with the line.
toml::table ParseToml(const std::string &path);

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// The file of --world: bodies that are seen and in the way.
#ifndef SWARM_WORLD_FILE_H
#define SWARM_WORLD_FILE_H

#include <string>
#include <vector>

#include "plant/world_body.h"

namespace twin
{

// Of the TOML file at `path`; none for "". Throws std::invalid_argument in one sentence.
std::vector<WorldBody> LoadWorld(const std::string &path);

// Of a file's text; `origin` names it in errors.
std::vector<WorldBody> ParseWorld(const std::string &text, const std::string &origin);

}  // namespace twin

#endif

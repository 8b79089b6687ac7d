// SPDX-License-Identifier: Apache-2.0
#ifndef MODEL_FILE_INSTALLED_H
#define MODEL_FILE_INSTALLED_H

#include <optional>
#include <string>

namespace twin
{

// Path of the installed file (model, MJCF) with that name and ending, whatever the working
// directory holds.
std::optional<std::string> FindInstalledModelFile(const std::string &file);

}  // namespace twin

#endif

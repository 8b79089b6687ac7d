// SPDX-License-Identifier: Apache-2.0
// Which known name a misspelt one is closest to, for error messages.
#ifndef EFFECTS_NEAREST_H
#define EFFECTS_NEAREST_H

#include <set>
#include <string>
#include <string_view>

namespace twin
{

// The name in `known`, which is not empty, that fewest single-letter edits turn `name` into.
std::string Nearest(std::string_view name, const std::set<std::string> &known);

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// What an error message says of a misspelt name, and how it quotes a text.
#ifndef EFFECTS_NEAREST_H
#define EFFECTS_NEAREST_H

#include <set>
#include <string>
#include <string_view>

namespace twin
{

// "the nearest known is 'x'": the name in `known`, which is not empty, that fewest single-letter
// edits turn `name` into; where that changes most of it, "known are x, y".
std::string NearestKnown(std::string_view name, const std::set<std::string> &known);

// In quotes; of a long text the beginning.
std::string Quoted(std::string_view text);

}  // namespace twin

#endif

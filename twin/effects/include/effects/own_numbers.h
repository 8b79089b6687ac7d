// SPDX-License-Identifier: Apache-2.0
// Names that a formula of a user's own may have: its own, and those of its numbers.
#ifndef EFFECTS_OWN_NUMBERS_H
#define EFFECTS_OWN_NUMBERS_H

#include <string>
#include <string_view>
#include <vector>

namespace twin
{

// A letter, then letters, figures and underscores: fit for formulas and for names of quantities.
bool IsPlainName(std::string_view text);

// What an effect's table in a model file has beside texts and numbers of the effect.
inline constexpr const char *kEffectKeys[] = {"name",         "std",         "bounds", "fitted_on",
                                              "error_before", "error_after", "share"};

// A number of a formula, as its author calls it.
struct OwnNumber
{
    std::string name, unit;  // unit "1" of a pure number
};

// Those of a list like "drag s/m, ratio": names with units behind them. Throws
// std::invalid_argument in one sentence where one is no name or stands twice, or if there are more
// than `most`.
std::vector<OwnNumber> OwnNumbers(std::string_view text, size_t most);

}  // namespace twin

#endif

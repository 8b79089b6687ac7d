// SPDX-License-Identifier: Apache-2.0
#include "effects/nearest.h"

#include <algorithm>
#include <vector>

namespace twin
{
namespace
{

// Number of single-letter edits that turn a into b (Levenshtein 1966).
size_t EditDistance(std::string_view a, std::string_view b)
{
    std::vector<size_t> row(b.size() + 1);
    for (size_t j = 0; j <= b.size(); ++j)
        row[j] = j;
    for (size_t i = 1; i <= a.size(); ++i)
    {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= b.size(); ++j)
        {
            const size_t substituted = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            row[j] = std::min({substituted, row[j] + 1, row[j - 1] + 1});
        }
    }
    return row[b.size()];
}

}  // namespace

std::string NearestKnown(std::string_view name, const std::set<std::string> &known)
{
    const auto &near =
        *std::min_element(known.begin(), known.end(), [name](const auto &a, const auto &b) {
            return EditDistance(name, a) < EditDistance(name, b);
        });
    if (5 * EditDistance(name, near) <= 2 * std::max(name.size(), near.size()))
        return "the nearest known is '" + near + "'";
    std::string list;
    for (const std::string &one : known)
        list.append(list.empty() ? "" : ", ").append(one);
    return "known are " + list;
}

std::string Quoted(std::string_view text)
{
    constexpr size_t kMost = 80;
    std::string quoted(1, '\'');
    quoted.append(text.substr(0, kMost));
    quoted.append(text.size() > kMost ? "...'" : "'");
    return quoted;
}

}  // namespace twin

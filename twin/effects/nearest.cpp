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

std::string Nearest(std::string_view name, const std::set<std::string> &known)
{
    return *std::min_element(known.begin(), known.end(), [name](const auto &a, const auto &b) {
        return EditDistance(name, a) < EditDistance(name, b);
    });
}

}  // namespace twin

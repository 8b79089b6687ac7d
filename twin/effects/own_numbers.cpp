// SPDX-License-Identifier: Apache-2.0
#include "effects/own_numbers.h"

#include <algorithm>
#include <cctype>
#include <stdexcept>

#include "effects/nearest.h"

namespace twin
{
namespace
{

bool IsLetter(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

std::string_view Trimmed(std::string_view text)
{
    const auto blank = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
    while (!text.empty() && blank(text.front()))
        text.remove_prefix(1);
    while (!text.empty() && blank(text.back()))
        text.remove_suffix(1);
    return text;
}

}  // namespace

bool IsPlainName(std::string_view text)
{
    return !text.empty() && IsLetter(text.front()) && std::ranges::all_of(text, [](char c) {
        return IsLetter(c) || (c >= '0' && c <= '9') || c == '_';
    });
}

std::vector<OwnNumber> OwnNumbers(std::string_view text, size_t most)
{
    const auto fail = [whole = std::string(text)](const std::string &what) {
        throw std::invalid_argument("equation.numbers = " + Quoted(whole) + ": " + what);
    };
    std::vector<OwnNumber> numbers;
    while (!Trimmed(text).empty())
    {
        const size_t end = std::min(text.find(','), text.size());
        const std::string_view entry = Trimmed(text.substr(0, end));
        text.remove_prefix(std::min(end + 1, text.size()));
        const size_t gap = std::min(entry.find_first_of(" \t"), entry.size());
        const std::string_view unit = Trimmed(entry.substr(gap));
        OwnNumber number{std::string(entry.substr(0, gap)), std::string(unit.empty() ? "1" : unit)};
        if (!IsPlainName(number.name))
            fail(Quoted(number.name) +
                 " is no name; write it with letters, figures and "
                 "underscores, as in 'drag s/m, ratio'");
        if (std::ranges::any_of(numbers, [&](const auto &n) { return n.name == number.name; }))
            fail("'" + number.name + "' stands twice; give each number a name of its own");
        numbers.push_back(std::move(number));
    }
    if (numbers.size() > most)
        fail("these are " + std::to_string(numbers.size()) +
             " numbers, and a formula has at most " + std::to_string(most));
    return numbers;
}

}  // namespace twin

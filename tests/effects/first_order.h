// SPDX-License-Identifier: Apache-2.0
// Effects that hold over a step what changes within it, such as place or time: right to first
// order.
#ifndef TESTS_EFFECTS_FIRST_ORDER_H
#define TESTS_EFFECTS_FIRST_ORDER_H

#include <set>
#include <string>

namespace twin::test
{

// Each is entered by its own test, before the first one runs.
inline std::set<std::string> &FirstOrder()
{
    static std::set<std::string> effects;
    return effects;
}

}  // namespace twin::test

#endif

// SPDX-License-Identifier: Apache-2.0
// Tables of the user's own, beside those that the firmware has.
#ifndef APP_BEHAVIORS_H
#define APP_BEHAVIORS_H

#include <deque>
#include <span>
#include <string>
#include <vector>

#include "fw/behavior.h"

namespace twin
{

// A given path; else behaviors.toml in the working directory, else in twinmill/ of the user's
// configuration, else empty.
std::string FindBehaviors(const std::string &path);

// Moved, not copied: the behaviours point at their names.
class OwnBehaviors
{
public:
    OwnBehaviors() = default;
    // Lines `name = "100,-0.5,100,0.5"` of a TOML file: see fw_table_parse(), of the file that
    // FindBehaviors() finds. Throws std::invalid_argument in one sentence if it holds anything
    // else.
    explicit OwnBehaviors(const std::string &path);
    OwnBehaviors(OwnBehaviors &&) = default;
    OwnBehaviors &operator=(OwnBehaviors &&) = default;

    std::span<const fw_behavior> All() const { return behaviors_; }

private:
    std::deque<std::string> names_;
    std::vector<fw_behavior> behaviors_;
};

}  // namespace twin

#endif

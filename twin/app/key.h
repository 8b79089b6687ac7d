// SPDX-License-Identifier: Apache-2.0
// The operator's key, the same file as the tools'.
#ifndef APP_KEY_H
#define APP_KEY_H

#include <string>

#include "radio/seal.h"

namespace twin
{

// A given path; where it is empty, swarm.key in the user's own folder.
std::string KeyPath(const std::string &path);

// The key of KeyPath(). One that is not there is made.
// Throws std::runtime_error in one sentence.
seal_key LoadKey(const std::string &path);

}  // namespace twin

#endif

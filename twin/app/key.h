// SPDX-License-Identifier: Apache-2.0
// The operator's key, the same file as the tools'.
#ifndef APP_KEY_H
#define APP_KEY_H

#include <string>

#include "radio/seal.h"

namespace twin
{

// `path`: of the key; empty: swarm.key in the user's own folder. A key that is not there is made.
// Throws std::runtime_error in one sentence.
seal_key LoadKey(const std::string &path);

}  // namespace twin

#endif

// SPDX-License-Identifier: Apache-2.0
// The named tables.
#ifndef FW_BEHAVIOR_H
#define FW_BEHAVIOR_H

#include <stddef.h>

#include "fw/table.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fw_behavior
{
    const char *name;
    struct fw_table table;
};

// @return the behaviour of exactly this name, or NULL.
const struct fw_behavior *fw_behavior_find(const char *name);

// For lists: every index below fw_behavior_count(), in alphabetical order; NULL past the end.
size_t fw_behavior_count(void);
const struct fw_behavior *fw_behavior_at(size_t index);

#ifdef __cplusplus
}
#endif

#endif

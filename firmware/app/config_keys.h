// SPDX-License-Identifier: Apache-2.0
// The one list of keys: names, ranges, where they go, what they mean.
#ifndef APP_CONFIG_KEYS_H
#define APP_CONFIG_KEYS_H

#include "config.h"

enum key_kind
{
    KEY_INTEGER,
    KEY_BOOL,
    KEY_TEXT,
};

struct config_key
{
    // One of key_kind.
    uint8_t kind;
    // Of the field in struct app_config.
    uint16_t offset;
    // Range of an integer, both ends included.
    int32_t min, max;
};

extern const struct config_key config_keys[];
extern const size_t config_key_count;
// For each of them its name and what it means, both ended by a 0: on the robot a pointer to each
// would take 36 bytes of the program's file.
extern const char config_texts[];

#endif

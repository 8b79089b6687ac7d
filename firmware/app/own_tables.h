// SPDX-License-Identifier: Apache-2.0
// Tables of the user's own, known by name beside those that are built in.
#ifndef APP_OWN_TABLES_H
#define APP_OWN_TABLES_H

#include "fw/table.h"
#include "lines.h"
#include "link.h"

#define OWN_TABLES_MAX 4096

struct own_tables
{
    int32_t count;
    struct
    {
        char name[LINK_NAME_MAX];
        struct fw_table table;
    } rows[OWN_TABLES_MAX];
};

// Adds a table, or takes the place of the one of that name. @param text as for fw_table_parse().
// @return false, and one sentence in error, if name or text are none or there is no room.
bool own_tables_add(struct own_tables *own, const char *name, const char *text,
                    char error[LINES_ERROR_MAX]);

// @return the user's table of this name, or else the built-in one, or NULL.
const struct fw_table *own_tables_find(const struct own_tables *own, const char *name);

#endif

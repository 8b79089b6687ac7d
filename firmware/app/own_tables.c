// SPDX-License-Identifier: Apache-2.0
#include "own_tables.h"

#include <stdio.h>
#include <string.h>

#include "fw/behavior.h"

// @return count if there is none of this name.
static int32_t place_of(const struct own_tables *own, const char *name)
{
    int32_t i = 0;
    while (i < own->count && strcmp(own->rows[i].name, name) != 0)
    {
        ++i;
    }
    return i;
}

bool own_tables_add(struct own_tables *own, const char *name, const char *text,
                    char error[LINES_ERROR_MAX])
{
    struct fw_table table;
    const int32_t place = place_of(own, name);
    if (!fw_table_parse(text, &table))
    {
        (void)snprintf(
            error, LINES_ERROR_MAX,
            "table '%.47s' must be speed,turn,speed,turn, for nothing seen and for seen, as in "
            "100,-0.5,100,0.5 (speed -100..100, turn -2..2), or 4, 8 or 16 such pairs",
            name);
        return false;
    }
    if (name[0] == '\0' || strlen(name) >= LINK_NAME_MAX)
    {
        (void)snprintf(error, LINES_ERROR_MAX, "'%.60s': a name has 1 to %d characters", name,
                       LINK_NAME_MAX - 1);
        return false;
    }
    if (place == OWN_TABLES_MAX)
    {
        (void)snprintf(error, LINES_ERROR_MAX, "'%.60s' is one too many: %d tables fit", name,
                       OWN_TABLES_MAX);
        return false;
    }
    (void)snprintf(own->rows[place].name, LINK_NAME_MAX, "%s", name);
    own->rows[place].table = table;
    own->count += place == own->count;
    return true;
}

const struct fw_table *own_tables_find(const struct own_tables *own, const char *name)
{
    const int32_t place = place_of(own, name);
    if (place < own->count)
    {
        return &own->rows[place].table;
    }
    const struct fw_behavior *behavior = fw_behavior_find(name);
    return behavior != NULL ? &behavior->table : NULL;
}

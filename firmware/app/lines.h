// SPDX-License-Identifier: Apache-2.0
// Texts of lines `key = value`: # at the beginning or after white space begins a comment, a value
// may stand in quotes, and then holds any #. TOML without tables.
#ifndef APP_LINES_H
#define APP_LINES_H

#include <stdbool.h>

#define LINES_ERROR_MAX 320

// Gets each pair. @return false, and one sentence in error, to end.
typedef bool lines_take(void *context, const char *key, const char *value, char *error);

// @param name of the text, for the error. @return false if a line is none, or take() said so; error
// then says where.
bool lines_parse(const char *name, const char *text, lines_take *take, void *context,
                 char error[LINES_ERROR_MAX]);

// The same from a file of at most 256 KB.
bool lines_load(const char *path, lines_take *take, void *context, char error[LINES_ERROR_MAX]);

#endif

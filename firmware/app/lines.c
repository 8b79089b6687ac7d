// SPDX-License-Identifier: Apache-2.0
#include "lines.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#define FILE_MAX_BYTES 262144

// Cuts white space off both ends, in place.
static char *trim(char *text)
{
    text += strspn(text, " \t\r");
    size_t length = strlen(text);
    while (length > 0 && strchr(" \t\r", text[length - 1]) != NULL)
    {
        --length;
    }
    text[length] = '\0';
    return text;
}

// Cuts the comment off, in place: # at the beginning or after white space begins one.
static void cut_comment(char *text)
{
    for (char *hash = strchr(text, '#'); hash != NULL; hash = strchr(hash + 1, '#'))
    {
        if (hash == text || hash[-1] == ' ' || hash[-1] == '\t')
        {
            *hash = '\0';
            return;
        }
    }
}

// Takes a value out of its quotes, or cuts the comment after a bare one. @return NULL if neither.
static char *value_of(char *text)
{
    text = trim(text);
    if (*text != '"')
    {
        cut_comment(text);
        return trim(text);
    }
    char *end = strchr(text + 1, '"');
    if (end == NULL)
    {
        return NULL;
    }
    *end = '\0';
    const char *rest = trim(end + 1);
    return *rest == '\0' || *rest == '#' ? text + 1 : NULL;
}

static bool parse_line(char *line, lines_take *take, void *context, char *error)
{
    line = trim(line);
    if (*line == '\0' || *line == '#')
    {
        return true;
    }
    char *equals = strchr(line, '=');
    char *value = equals != NULL ? value_of(equals + 1) : NULL;
    if (value == NULL)
    {
        (void)snprintf(error, LINES_ERROR_MAX, "'%.60s' is not of the form key = value", line);
        return false;
    }
    *equals = '\0';
    return take(context, trim(line), value, error);
}

bool lines_parse(const char *name, const char *text, lines_take *take, void *context,
                 char error[LINES_ERROR_MAX])
{
    for (int number = 1; *text != '\0'; ++number)
    {
        char line[256];
        char cause[LINES_ERROR_MAX] = "the line is too long: at most 255 characters";
        const size_t length = strcspn(text, "\n");
        const bool fits = length < sizeof line;
        if (fits)
        {
            memcpy(line, text, length);
            line[length] = '\0';
        }
        if (!fits || !parse_line(line, take, context, cause))
        {
            (void)snprintf(error, LINES_ERROR_MAX, "%.100s, line %d: %.180s", name, number, cause);
            return false;
        }
        text += length + (text[length] == '\n');
    }
    return true;
}

bool lines_load(const char *path, lines_take *take, void *context, char error[LINES_ERROR_MAX])
{
    static char text[FILE_MAX_BYTES];
    FILE *file = fopen(path, "rb");
    if (file == NULL)
    {
        (void)snprintf(error, LINES_ERROR_MAX, "%.200s: cannot be read: %s", path, strerror(errno));
        return false;
    }
    const size_t length = fread(text, 1, sizeof text - 1, file);
    const bool whole = length < sizeof text - 1 && !ferror(file);
    (void)fclose(file);
    text[length] = '\0';
    if (!whole || strlen(text) != length)
    {
        (void)snprintf(error, LINES_ERROR_MAX, "%.200s: is no text of at most %d bytes", path,
                       FILE_MAX_BYTES - 2);
        return false;
    }
    return lines_parse(path, text, take, context, error);
}

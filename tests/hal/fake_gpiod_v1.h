// SPDX-License-Identifier: Apache-2.0
// The calls of libgpiod 1 that the panel makes, answered by an array of lines.
#ifndef TESTS_HAL_FAKE_GPIOD_V1_H
#define TESTS_HAL_FAKE_GPIOD_V1_H

#include <errno.h>
#include <gpiod.h>
#include <stdbool.h>
#include <string.h>

#define FAKE_LINES 54

struct gpiod_line
{
    bool requested, is_output;
    int value, flags;
};

struct gpiod_chip
{
    int open_count;
};

static struct gpiod_chip fake_chip;
static struct gpiod_line fake_lines[FAKE_LINES];
static struct gpiod_line *fake_busy;
// Reading and writing fails from here on.
static bool fake_gone;

struct gpiod_chip *gpiod_chip_open(const char *path)
{
    if (strcmp(path, "/dev/gpiochip0") != 0)
    {
        errno = ENOENT;
        return NULL;
    }
    ++fake_chip.open_count;
    return &fake_chip;
}

void gpiod_chip_close(struct gpiod_chip *chip)
{
    --chip->open_count;
}

struct gpiod_chip *gpiod_line_get_chip(struct gpiod_line *line)
{
    line->requested = false;
    return &fake_chip;
}

struct gpiod_line *gpiod_chip_get_line(struct gpiod_chip *chip, unsigned offset)
{
    (void)chip;
    errno = EINVAL;
    return offset < FAKE_LINES ? &fake_lines[offset] : NULL;
}

static int fake_request(struct gpiod_line *line, bool is_output, int value, int flags)
{
    if (line->requested || line == fake_busy)
    {
        errno = EBUSY;
        return -1;
    }
    line->requested = true;
    line->is_output = is_output;
    line->flags = flags;
    // A pulled-up input that nobody presses is high.
    line->value = is_output ? value : 1;
    return 0;
}

int gpiod_line_request_output(struct gpiod_line *line, const char *consumer, int value)
{
    (void)consumer;
    return fake_request(line, true, value, 0);
}

int gpiod_line_request_input_flags(struct gpiod_line *line, const char *consumer, int flags)
{
    (void)consumer;
    return fake_request(line, false, 0, flags);
}

int gpiod_line_get_value(struct gpiod_line *line)
{
    errno = ENODEV;
    return fake_gone ? -1 : line->value;
}

int gpiod_line_set_value(struct gpiod_line *line, int value)
{
    if (fake_gone || !line->is_output)
    {
        errno = ENODEV;
        return -1;
    }
    line->value = value;
    return 0;
}

#endif

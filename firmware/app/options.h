// SPDX-License-Identifier: Apache-2.0
// The command line.
#ifndef APP_OPTIONS_H
#define APP_OPTIONS_H

#include "config.h"

enum options_action
{
    // Drive.
    OPTIONS_RUN,
    // Zero to all wheels, and nothing else.
    OPTIONS_STOP,
    OPTIONS_PRINT_CONFIG,
    // Help and version were printed.
    OPTIONS_DONE,
    OPTIONS_BAD,
};

struct options
{
    struct app_config config;
    bool dry_run;
};

// Reads the command line over the configuration file over the defaults. A mistake is told on
// stderr.
enum options_action parse_options(int argc, char **argv, struct options *options);

#endif

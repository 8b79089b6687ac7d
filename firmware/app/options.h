// SPDX-License-Identifier: Apache-2.0
// The command line.
#ifndef APP_OPTIONS_H
#define APP_OPTIONS_H

#include "config.h"
#include "own_tables.h"

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
    // Of the file that the configuration names, and its own table under its behaviour's name.
    struct own_tables own;
    bool dry_run;
    // Who runs the program starts the robot by that, and sees it; autostart in the configuration
    // asks for a stop that outlives the program.
    bool starts;
    // Nothing was left out because it could not be understood, as --stop does.
    bool is_whole;
    // The command line, to be read again.
    int argc;
    char **argv;
};

// Reads the command line over the configuration file over the defaults. A mistake is told on
// stderr; with --stop there is none: what cannot be understood is left out.
enum options_action parse_options(int argc, char **argv, struct options *options);

#endif

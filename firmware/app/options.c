// SPDX-License-Identifier: Apache-2.0
#include "options.h"

#include <getopt.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "fw/behavior.h"
#include "say.h"

#define DEFAULT_FILE "/etc/turbopi/turbopi.conf"

static const char help[] =
    "usage: turbopi [options]\n"
    "Drives a TurboPi by one bit: camera frame to four wheel duties, telemetry on LCM.\n"
    "\n"
    "  -b, --behavior NAME   table to play, built in or of your own (milling)\n"
    "  -c, --config FILE     keys and values (" DEFAULT_FILE
    ", if it is there)\n"
    "      --camera DEVICE   V4L2 device, stub:FILE or stub:unix:SOCKET (/dev/video0)\n"
    "      --board KIND      auto, i2c, uart, stub, stub:FILE or stub:camera (auto)\n"
    "      --script FILE     plays CSV inputs or duties once instead of the table\n"
    "      --io-tsv FILE     also logs in the format of the authors' robots\n"
    "      --lcm-url URL     where telemetry goes (udpm://239.255.76.67:7667?ttl=0)\n"
    "      --set KEY=VALUE   any key of the configuration; may be repeated\n"
    "      --start           drives at once (waits for the button or a command)\n"
    "  -n, --dry-run         does all but move: no motor board, no panel\n"
    "      --stop            writes zero to all wheels and ends\n"
    "      --print-config    prints the configuration with its meanings and ends\n"
    "      --version         prints the version and ends\n"
    "  -h, --help            prints this and ends\n"
    "\n"
    "example, without a robot:\n"
    "  $ turbopi --dry-run --start --camera stub:frames.yuyv --lcm-url ''\n"
    "\n"
    "exit codes: 0 ended as asked, 1 failed, 2 the command line or the configuration is wrong,\n"
    "            3 another program has the motor board, 4 rows of a log were lost\n"
    "Wheels off the ground at the first try: turbopi --print-config lists signs and speed cap.\n";

enum option_code
{
    OPTION_CAMERA = 256,
    OPTION_BOARD,
    OPTION_SCRIPT,
    OPTION_IO_TSV,
    OPTION_LCM_URL,
    OPTION_SET,
    OPTION_START,
    OPTION_STOP,
    OPTION_PRINT_CONFIG,
    OPTION_VERSION,
};

static const struct option long_options[] = {
    {"behavior", required_argument, NULL, 'b'},
    {"config", required_argument, NULL, 'c'},
    {"camera", required_argument, NULL, OPTION_CAMERA},
    {"board", required_argument, NULL, OPTION_BOARD},
    {"script", required_argument, NULL, OPTION_SCRIPT},
    {"io-tsv", required_argument, NULL, OPTION_IO_TSV},
    {"lcm-url", required_argument, NULL, OPTION_LCM_URL},
    {"set", required_argument, NULL, OPTION_SET},
    {"start", no_argument, NULL, OPTION_START},
    {"dry-run", no_argument, NULL, 'n'},
    {"stop", no_argument, NULL, OPTION_STOP},
    {"print-config", no_argument, NULL, OPTION_PRINT_CONFIG},
    {"version", no_argument, NULL, OPTION_VERSION},
    {"help", no_argument, NULL, 'h'},
    {NULL, 0, NULL, 0},
};

static const char short_options[] = "b:c:nh";

// KEY=VALUE.
static bool set_pair(struct app_config *config, const char *pair, char *error)
{
    char key[64];
    const char *equals = strchr(pair, '=');
    if (equals == NULL || (size_t)(equals - pair) >= sizeof key)
    {
        (void)snprintf(error, CONFIG_ERROR_MAX, "--set: '%.100s': must be KEY=VALUE", pair);
        return false;
    }
    memcpy(key, pair, (size_t)(equals - pair));
    key[equals - pair] = '\0';
    return config_set(config, key, equals + 1, error);
}

// The file comes first, wherever --config stands, so that the other options go over it.
static bool load_file(int argc, char **argv, struct app_config *config, char *error)
{
    const char *path = NULL;
    for (int code; (code = getopt_long(argc, argv, short_options, long_options, NULL)) != -1;)
    {
        if (code == '?')
        {
            (void)snprintf(error, CONFIG_ERROR_MAX, "see turbopi --help");
            return false;
        }
        path = code == 'c' ? optarg : path;
    }
    if (optind < argc)
    {
        (void)snprintf(error, CONFIG_ERROR_MAX, "'%.100s': not an option: see turbopi --help",
                       argv[optind]);
        return false;
    }
    optind = 1;
    if (path == NULL)
    {
        FILE *file = fopen(DEFAULT_FILE, "rb");
        if (file == NULL)
        {
            return true;
        }
        (void)fclose(file);
        path = DEFAULT_FILE;
    }
    return config_load(config, path, error);
}

static bool apply(int code, struct options *options, enum options_action *action, char *error)
{
    struct app_config *config = &options->config;
    switch (code)
    {
        case 'b': return config_set(config, "behavior", optarg, error);
        case OPTION_CAMERA: return config_set(config, "camera", optarg, error);
        case OPTION_BOARD: return config_set(config, "board", optarg, error);
        case OPTION_SCRIPT: return config_set(config, "script", optarg, error);
        case OPTION_IO_TSV: return config_set(config, "io_tsv", optarg, error);
        case OPTION_LCM_URL: return config_set(config, "lcm_url", optarg, error);
        case OPTION_SET: return set_pair(config, optarg, error);
        case OPTION_START: options->starts = true; break;
        case 'n': options->dry_run = true; break;
        case OPTION_STOP: *action = OPTIONS_STOP; break;
        case OPTION_PRINT_CONFIG: *action = OPTIONS_PRINT_CONFIG; break;
        case OPTION_VERSION:
            (void)puts("turbopi " TWINMILL_VERSION);
            *action = OPTIONS_DONE;
            break;
        case 'h':
            (void)fputs(help, stdout);
            *action = OPTIONS_DONE;
            break;
        default: break;
    }
    return true;
}

static bool take_own(void *context, const char *name, const char *text, char *error)
{
    struct options *options = context;
    struct app_config *config = &options->config;
    const bool plays = config->table[0] == '\0' && strcmp(name, config->behavior) == 0;
    return own_tables_add(&options->own, name, text, error) &&
           (!plays || config_set(config, "table", text, error));
}

// Reads the file of own tables; the one that is to be played comes into the configuration.
static bool load_own(struct options *options, char *error)
{
    const struct app_config *config = &options->config;
    const bool expected = strcmp(config->behaviors, CONFIG_BEHAVIORS) != 0;
    if (config->behaviors[0] != '\0' && (expected || access(CONFIG_BEHAVIORS, F_OK) == 0) &&
        !lines_load(config->behaviors, take_own, options, error))
    {
        return false;
    }
    return config->table[0] == '\0' ||
           own_tables_add(&options->own, config->behavior, config->table, error);
}

static bool check(const struct app_config *config, char *error)
{
    if (config->table[0] == '\0' && fw_behavior_find(config->behavior) == NULL)
    {
        int used = snprintf(error, CONFIG_ERROR_MAX, "behavior: '%.60s': must be one of",
                            config->behavior);
        for (size_t i = 0; i < fw_behavior_count(); ++i)
        {
            used += snprintf(error + used, CONFIG_ERROR_MAX - (size_t)used, " %s",
                             fw_behavior_at(i)->name);
        }
        return false;
    }
    struct fw_config core;
    const enum fw_err err = config_core(config, &core);
    if (err != FW_OK)
    {
        (void)snprintf(error, CONFIG_ERROR_MAX, "configuration: %s", fw_err_str(err));
    }
    return err == FW_OK;
}

static bool wants_stop(int argc, char **argv)
{
    bool stop = false;
    opterr = 0;
    optind = 1;
    for (int code; (code = getopt_long(argc, argv, short_options, long_options, NULL)) != -1;)
    {
        stop = stop || code == OPTION_STOP;
    }
    opterr = !stop;
    optind = 1;
    return stop;
}

// All that can be understood.
static void read_for_stop(int argc, char **argv, struct options *options)
{
    enum options_action action;
    char error[CONFIG_ERROR_MAX];
    const char *path = DEFAULT_FILE;
    bool is_whole = true;
    for (int code; (code = getopt_long(argc, argv, short_options, long_options, NULL)) != -1;)
    {
        path = code == 'c' ? optarg : path;
    }
    is_whole = config_load_what_can_be(&options->config, path);
    optind = 1;
    for (int code; (code = getopt_long(argc, argv, short_options, long_options, NULL)) != -1;)
    {
        is_whole = code != '?' && apply(code, options, &action, error) && is_whole;
    }
    options->is_whole = is_whole;
}

enum options_action parse_options(int argc, char **argv, struct options *options)
{
    char error[CONFIG_ERROR_MAX] = "";
    enum options_action action = OPTIONS_RUN;
    options->argc = argc;
    options->argv = argv;
    options->dry_run = options->starts = false;
    options->own.count = 0;
    options->is_whole = true;
    config_default(&options->config);
    if (wants_stop(argc, argv))
    {
        read_for_stop(argc, argv, options);
        return OPTIONS_STOP;
    }
    bool ok = load_file(argc, argv, &options->config, error);
    while (ok && action != OPTIONS_DONE)
    {
        const int code = getopt_long(argc, argv, short_options, long_options, NULL);
        if (code == -1)
        {
            ok = load_own(options, error) && check(&options->config, error);
            break;
        }
        ok = apply(code, options, &action, error);
    }
    if (!ok)
    {
        say("%s", error);
        return OPTIONS_BAD;
    }
    return action;
}
